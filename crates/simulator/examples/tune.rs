use std::sync::Arc;
use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_simulator::*;
use trepan_soft::*;
use trepan_tled::{Config, Relaxation, Settling as Rest, Tled};
fn solver(body: &Body, minutes: f64) -> Tled {
    let Relaxation { share, time_ms } = Relaxation::BRAIN;
    let relaxed: f32 =
        share.iter().zip(&time_ms).map(|(s, t)| s * (1.0 - (-60e3 * minutes / f64::from(*t)).exp()) as f32).sum();
    let relaxation = Relaxation { share: [relaxed, 0.0], time_ms: [1.0; 2] };
    Tled::new(body, &Config { averaged_pressure: true, mass_scaling: f32::INFINITY, relaxation, ..Config::default() })
        .unwrap()
}
struct Still {
    body: Body,
    solver: Tled,
    wall: Option<SkullWall>,
    loads: Loads,
}
impl Still {
    fn rest(&mut self, minutes: f64, verbose: bool) {
        let before = self.solver.positions().to_vec();
        self.solver = solver(&self.body, minutes);
        for (n, at) in (0u32..).zip(&before) {
            self.solver.set_node(n, *at - self.body.mesh.positions[n as usize], Vec3::ZERO);
        }
        for _ in 0..6 {
            let mut skull = NodalContacts::none();
            self.wall.as_mut().unwrap().press(self.solver.positions(), false, &mut skull);
            let mut all = self.loads.contacts.clone();
            let bared = |n: u32| self.body.anchors.iter().any(|a| a.node == n && a.open_mm2 > 0.0);
            skull.planes().iter().filter(|p| !bared(p.node)).for_each(|p| all.push_plane(*p));
            let s = self
                .solver
                .settle(&Loads { contacts: all, ..self.loads.clone() }, &Rest { tolerance_mm: 0.02, steps: 1500 });
            if verbose {
                println!("   settle {} steps left {:.3} planes {}", s.steps, s.left_mm, skull.planes().len());
            }
        }
    }
    fn moved(&self, n: usize) -> Vec3 {
        self.solver.positions()[n] - self.body.mesh.positions[n]
    }
    fn around(&self, p: Vec3, r: f32) -> Vec<usize> {
        (0..self.body.mesh.positions.len()).filter(|n| self.body.mesh.positions[*n].distance(p) < r).collect()
    }
    fn mean(&self, p: Vec3, r: f32) -> Vec3 {
        let a = self.around(p, r);
        a.iter().map(|n| self.moved(*n)).sum::<Vec3>() / a.len() as f32
    }
    fn bared(&self) -> Vec<(usize, f32)> {
        self.body.anchors.iter().filter(|a| a.open_mm2 > 0.0).map(|a| (a.node as usize, a.open_mm2)).collect()
    }
    fn cortex(&self) -> Vec3 {
        let b = self.bared();
        b.iter().map(|n| self.moved(n.0)).sum::<Vec3>() / b.len() as f32
    }
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scale: f32 = a[2].parse().unwrap();
    let loss: f32 = a[3].parse().unwrap();
    let case_head = trepan_fixtures::case_head();
    let tissues = vec![TissueSource::ventricles_of_aseg(case_head.aseg)];
    let inputs = Inputs {
        name: Some(case_head.name),
        ct: Some(case_head.ct),
        mri: Some(case_head.mri),
        labels: Some(case_head.labels),
        tissues,
    };
    let recipe = Recipe { spacing_mm: 1.0, tets: 12_000, ..Recipe::default() };
    let case = open_case(Program::Integrated, &inputs, &recipe, &Cache::of_user().unwrap()).unwrap();
    let scene = Scene::new(Program::Integrated, case).unwrap();
    let (bone, brain) = (scene.bone.unwrap(), scene.brain.unwrap());
    let plan = Plan::new(Some(&bone), scene.site, Program::Craniotomy.tray()[0].tip_radius_mm, 12.0).unwrap();
    let up = -plan.site.inward;
    let make = || {
        let Held { fixed, mut anchors, wall } = brain.held_in_skull(Arc::clone(&bone), &plan).unwrap();
        anchors.iter_mut().filter(|a| a.in_fluid > 0.0).for_each(|a| {
            a.along *= scale;
            a.across *= scale;
        });
        let body = Body {
            mesh: brain.mesh.clone(),
            fixed,
            anchors,
            materials: TissueClass::ALL.map(|c| c.material(0.003)).to_vec(),
            material_of_tet: brain.class_of_tet.iter().map(|c| c - 1).collect(),
        };
        Still { solver: solver(&body, 0.0), body, wall, loads: Loads::default() }
    };
    let s = make();
    let b = s.body.mesh.bounds();
    println!(
        "nodes {} tets {} fixed {} anchors {} open {} up {up} bounds {} {}",
        s.body.mesh.positions.len(),
        s.body.mesh.tets.len(),
        s.body.fixed.len(),
        s.body.anchors.len(),
        s.bared().len(),
        b.min,
        b.max
    );
    let w = s.wall.as_ref().unwrap();
    let mut gaps: Vec<f32> = w.border().iter().map(|n| w.gap_mm(s.body.mesh.positions[n.node as usize])).collect();
    gaps.sort_by(f32::total_cmp);
    println!(
        "gaps p10 {:.1} p50 {:.1} p90 {:.1}; falx {} veins {}",
        gaps[gaps.len() / 10],
        gaps[gaps.len() / 2],
        gaps[gaps.len() * 9 / 10],
        s.body.anchors.iter().filter(|a| a.across == 0.0 && a.along > 0.0).count(),
        s.body.anchors.iter().filter(|a| a.in_fluid > 0.0 && a.in_fluid < 1.0).count()
    );
    let k: f32 = s
        .body
        .anchors
        .iter()
        .map(|a| a.along * a.normal.y * a.normal.y + a.across * (1.0 - a.normal.y * a.normal.y))
        .sum();
    println!("stiffness along y {k} N/mm");
    let centre = b.centre();
    if a[1].contains('s') {
        for (name, from, to) in [
            ("prone-supine", Vec3::Y, Vec3::NEG_Y),
            ("side", Vec3::X, Vec3::NEG_X),
            ("sitting", Vec3::NEG_Y, Vec3::NEG_Z),
        ] {
            let mut s = make();
            s.loads.gravity = 9.81e-3 / 30.0 * (to - from);
            let t = std::time::Instant::now();
            s.rest(10.0, name == "side");
            let mut tissue = vec![true; s.body.mesh.positions.len()];
            s.body
                .mesh
                .tets
                .iter()
                .zip(&s.body.material_of_tet)
                .filter(|(_, m)| **m == 3)
                .for_each(|(t, _)| t.iter().for_each(|n| tissue[*n as usize] = false));
            let deep: Vec<f32> =
                s.around(centre, 25.0).iter().filter(|n| tissue[**n]).map(|n| s.moved(*n).length()).collect();
            println!(
                "{name}: deep {:.2}..{:.2} centre {:.2} pineal {:.2} max {:.2} in {:.1} s",
                deep.iter().copied().fold(9.0, f32::min),
                deep.iter().copied().fold(0.0, f32::max),
                s.mean(centre, 10.0),
                s.mean(centre - 10.0 * Vec3::Y, 10.0),
                (0..s.body.mesh.positions.len()).map(|n| s.moved(n).length()).fold(0.0, f32::max),
                t.elapsed().as_secs_f64()
            );
        }
    }
    if a[1].contains('o') {
        let mut s = make();
        let mut settling = Settling::draining(&brain.mesh, up, loss, 1.0);
        for m in [0.5, 5.0, 10.0, 20.0, 35.0, 50.7, 75.0, 107.2, 150.0] {
            let t = std::time::Instant::now();
            settling.load(Phase::Brain, 0.0, &mut s.loads);
            settling.load(Phase::Brain, m * 60e3, &mut s.loads);
            s.loads.fluid.opening_mpa = 0.0;
            s.rest(m, m == 20.0);
            println!(
                "{m} min: level below top {:.1} cortex {:.2} along up {:.2} centre {:.2} in {:.1} s",
                b.max.dot(up).max(b.min.dot(up)) - s.loads.fluid.level_mm,
                s.cortex().length(),
                s.cortex().dot(up),
                s.mean(centre, 15.0),
                t.elapsed().as_secs_f64()
            );
        }
    }
    if a[1].contains('p') {
        for (mmhg, hz) in [(1.81, 1.0), (1.0, 0.2f64)] {
            let mut s = make();
            s.loads.fluid.opening_mpa = mmhg * 1.333e-4;
            s.rest(1.0 / (6.283 * hz * 60.0), true);
            println!("{mmhg} mmHg: {:.3}", s.cortex().dot(up));
        }
    }
}
