//! A wound: sources that bleed, and what tools do to them.

use crate::border::Border;
use crate::film::{Account, Film, PL};
use trepan_geometry::Vec3;
use trepan_measurements::bleeding;
use trepan_mesh::{NONE, Split, TetMesh};

/// pl/ms in a ml/min.
const PER_MIN: f32 = 1e3 * PL / 60e3;
/// Parts in which fluid flows, one a step; numerical.
const PARTS: usize = 9;
/// Longest time that a turn makes up for, ms; numerical: blood does not flow in a pause.
const LONGEST_MS: f64 = 50.0;
/// Parts of an edge in the lattice of points on a face, numerical.
const LATTICE: u8 = 4;
/// Blood over a burn from which that is not seen, mm; numerical.
const HIDES_MM: f32 = 0.1;
/// Depth of blood that a stain counts to, mm, and the stain of it; numerical. Beyond is a burn.
const STAIN: (f32, f32) = (2.0, 200.0);

/// How a tetrahedron bleeds once it is cut.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Perfusion {
    /// Its capillaries, over those of brain; 0 where nothing bleeds.
    pub capillaries: f32,
    /// A vessel that is cut where it comes to light, over the usual one; 0 for none.
    pub vessel: f32,
}

/// What a tool does, with its tip as a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    /// Takes fluid away.
    Suck,
    /// Closes sources by heat and rinses.
    Coagulate,
}

/// A face that bleeds.
#[derive(Clone, Copy, Debug)]
struct Source {
    face: u32,
    /// At first, pl/ms.
    rate: f32,
    since_ms: f64,
    /// Until it stops by itself, ms.
    lasts_ms: f64,
    /// Heat so far, ms of contact.
    heat_ms: f32,
    /// Less than a picolitre that is still to come.
    due: f32,
}

impl Source {
    fn rate_at(&self, now_ms: f64) -> f32 {
        self.rate * (1.0 - (now_ms - self.since_ms) / self.lasts_ms).max(0.0) as f32
    }
}

/// Blood on a mesh of which tetrahedra are taken away.
pub struct Wound {
    border: Border,
    film: Film,
    perfusion: Vec<Perfusion>,
    sources: Vec<Source>,
    /// Faces whose source was closed by heat.
    burnt: Vec<u32>,
    /// For each node: the sum of depths of blood around it, how many, and burns.
    sums: Vec<[f32; 3]>,
    stains: Vec<u8>,
    /// Tetrahedra that went in this turn, which of their faces were border, and what came to light.
    going: Vec<(u32, [bool; 4], [u32; 4])>,
    /// The next part of the turn, when the last one ended, and how long it was, ms.
    part: usize,
    last_ms: f64,
    turn_ms: f32,
    coagulated: u32,
}

impl Wound {
    /// Of a mesh, with the perfusion of each tetrahedron; those without one do not bleed.
    pub fn of(mesh: &TetMesh, perfusion: &[Perfusion]) -> Self {
        let border = Border::of(mesh);
        let (nodes, tets) = (mesh.positions.len(), mesh.tets.len());
        Self {
            film: Film::on(&border),
            perfusion: (0..tets).map(|tet| perfusion.get(tet).copied().unwrap_or_default()).collect(),
            sources: Vec::with_capacity(border.faces()),
            burnt: Vec::with_capacity(border.faces()),
            border,
            sums: vec![[0.0; 3]; nodes],
            stains: vec![0; nodes],
            going: Vec::with_capacity(tets),
            part: PARTS,
            last_ms: f64::INFINITY,
            turn_ms: 0.0,
            coagulated: 0,
        }
    }

    /// Takes a tetrahedron away: what comes to light bleeds.
    pub fn remove(&mut self, tet: u32, positions: &[Vec3], now_ms: f64) {
        let was_border = [0, 1, 2, 3].map(|face| self.border.is_border(4 * tet + face));
        let exposed = self.border.remove(tet);
        self.sources.retain(|source| source.face / 4 != tet);
        self.burnt.retain(|face| face / 4 != tet);
        if was_border.contains(&true) && self.going.len() < self.going.capacity() {
            self.going.push((tet, was_border, exposed));
        }
        for face in exposed.into_iter().filter(|&face| face != NONE) {
            self.bleed(face, positions, now_ms);
        }
    }

    /// Follows splits of nodes; where nodes have `positions`, mm, what comes to light bleeds.
    /// Allocates.
    pub fn split(&mut self, splits: &[Split], positions: Option<&[Vec3]>, now_ms: f64) {
        let exposed = self.border.split(splits);
        let nodes = splits.iter().map(|split| split.node as usize + 1).fold(self.stains.len(), usize::max);
        self.stains.resize(nodes, 0);
        self.sums.resize(nodes, [0.0; 3]);
        for face in exposed {
            match positions {
                Some(positions) => self.bleed(face, positions, now_ms),
                None => self.perfusion[face as usize / 4].vessel = 0.0,
            }
        }
    }

    fn bleed(&mut self, face: u32, positions: &[Vec3], now_ms: f64) {
        if positions.len() != self.stains.len() {
            return;
        }
        let Perfusion { capillaries, vessel } = self.perfusion[face as usize / 4];
        let [a, b, c] = self.border.nodes(face).map(|node| positions[node as usize]);
        let area_mm2 = 0.5 * (b - a).cross(c - a).length();
        let of_area = capillaries * bleeding::CAPILLARY_RATE.f32() * 1e-2 * area_mm2;
        let mut open = |ml_per_min: f32, minutes: f64| {
            if ml_per_min > 0.0 && self.sources.len() < self.sources.capacity() {
                let (rate, lasts_ms) = (ml_per_min * PER_MIN, minutes * 60e3);
                self.sources.push(Source { face, rate, since_ms: now_ms, lasts_ms, heat_ms: 0.0, due: 0.0 });
            }
        };
        open(of_area, bleeding::CAPILLARY_TIME.value);
        open(vessel * bleeding::VESSEL_RATE.f32(), bleeding::VESSEL_TIME.value);
        // It is cut once.
        self.perfusion[face as usize / 4].vessel = 0.0;
    }

    /// Goes on to a time: a tenth of a turn in which sources bleed, the tool acts and fluid flows.
    /// `up` is the unit vector against gravity; of each tool its tip, mm, the radius of that, and
    /// what it does.
    pub fn step(
        &mut self,
        now_ms: f64,
        positions: &[Vec3],
        up: Vec3,
        tools: impl IntoIterator<Item = (Vec3, f32, Act)>,
    ) {
        if positions.len() != self.stains.len() {
            return;
        }
        if self.part < PARTS {
            let of = [self.part, PARTS];
            self.film.flow(&self.border, positions, up, self.turn_ms, of);
            self.part += 1;
            return;
        }
        self.part = 0;
        self.film.settle();
        for at in 0..self.going.len() {
            let (tet, was_border, exposed) = self.going[at];
            for face in (0..4).filter(|&face| was_border[face as usize]) {
                self.film.leave(4 * tet + face, exposed);
            }
        }
        self.going.clear();
        let since_ms = now_ms - std::mem::replace(&mut self.last_ms, now_ms);
        self.turn_ms = since_ms.clamp(0.0, LONGEST_MS) as f32;
        for source in &mut self.sources {
            source.due += self.turn_ms * source.rate_at(now_ms);
            let pl = source.due.max(0.0) as u64;
            source.due -= pl as f32;
            self.film.pour(source.face, [pl, 0]);
        }
        self.sources.retain(|source| now_ms - source.since_ms < source.lasts_ms);
        for (tip, radius_mm, act) in tools {
            match act {
                Act::Suck => self.suck(positions, tip, radius_mm, self.turn_ms),
                Act::Coagulate => self.coagulate(positions, tip, radius_mm, self.turn_ms),
            }
        }
        self.stain(positions);
    }

    /// Takes what lies within reach, face by face.
    fn suck(&mut self, positions: &[Vec3], tip: Vec3, radius_mm: f32, dt_ms: f32) {
        let mut left_pl = (bleeding::SUCTION.f32() * PER_MIN * dt_ms) as u64;
        let reach_mm = radius_mm + bleeding::SUCTION_REACH.f32();
        for at in 0..self.film.wet().len() {
            let face = self.film.wet()[at];
            if self.middle(positions, face).distance(tip) < reach_mm {
                left_pl -= self.film.suck(face, left_pl);
            }
        }
    }

    /// Heats the sources within reach, and rinses the one that is nearest.
    fn coagulate(&mut self, positions: &[Vec3], tip: Vec3, radius_mm: f32, dt_ms: f32) {
        let reach_mm = radius_mm + bleeding::COAGULATION_REACH.f32();
        let mut nearest = (reach_mm, None);
        for at in 0..self.sources.len() {
            let face = self.sources[at].face;
            let away_mm = self.away(positions, face, tip);
            if away_mm < reach_mm {
                self.sources[at].heat_ms += dt_ms;
            }
            if away_mm < nearest.0 {
                nearest = (away_mm, Some(face));
            }
        }
        if let (_, Some(face)) = nearest {
            self.film.pour(face, [0, (bleeding::RINSE.f32() * PER_MIN * dt_ms) as u64]);
        }
        let (burnt, coagulated) = (&mut self.burnt, &mut self.coagulated);
        self.sources.retain(|source| {
            let closed = source.heat_ms >= bleeding::COAGULATION_TIME.f32() * 1e3;
            if closed && burnt.len() < burnt.capacity() {
                burnt.push(source.face);
            }
            *coagulated += u32::from(closed);
            !closed
        });
    }

    fn middle(&self, positions: &[Vec3], face: u32) -> Vec3 {
        self.border.nodes(face).map(|node| positions[node as usize]).into_iter().sum::<Vec3>() / 3.0
    }

    /// Distance of a place from a face, by a lattice of points on it.
    fn away(&self, positions: &[Vec3], face: u32, place: Vec3) -> f32 {
        let [a, b, c] = self.border.nodes(face).map(|node| positions[node as usize]);
        let rows = (0..=LATTICE).flat_map(|i| (0..=LATTICE - i).map(move |j| [f32::from(i), f32::from(j)]));
        let points = rows.map(|[i, j]| a + (i * (b - a) + j * (c - a)) / f32::from(LATTICE));
        points.map(|point| point.distance_squared(place)).fold(f32::INFINITY, f32::min).sqrt()
    }

    fn stain(&mut self, positions: &[Vec3]) {
        self.sums.fill([0.0; 3]);
        for &face in self.film.wet() {
            let depth_mm = self.film.blood_mm(&self.border, positions, face);
            for node in self.border.nodes(face) {
                let sum = &mut self.sums[node as usize];
                (sum[0], sum[1]) = (sum[0] + depth_mm.min(STAIN.0), sum[1] + 1.0);
            }
        }
        for &face in &self.burnt {
            self.border.nodes(face).into_iter().for_each(|node| self.sums[node as usize][2] = 1.0);
        }
        for (stain, [depth_mm, count, burns]) in self.stains.iter_mut().zip(&self.sums) {
            let depth_mm = depth_mm / count.max(1.0);
            let is_seen = *burns > 0.0 && depth_mm < HIDES_MM;
            *stain = if is_seen { u8::MAX } else { (depth_mm / STAIN.0 * STAIN.1) as u8 };
        }
    }

    /// Stain of each node: blood of 0 to 2 mm as 0 to 200, and 255 for a burn.
    pub fn stains(&self) -> &[u8] {
        &self.stains
    }

    /// Where blood and saline came from and went.
    pub fn account(&self) -> Account {
        self.film.account()
    }

    /// Blood and saline that lie on the border, pl.
    pub fn lies_pl(&self) -> [u64; 2] {
        self.film.lies_pl()
    }

    /// Blood that comes at a time, ml/min.
    pub fn rate_ml_per_min(&self, now_ms: f64) -> f32 {
        self.sources.iter().fold(0.0, |sum, source| sum + source.rate_at(now_ms)) / PER_MIN
    }

    /// The place that bleeds most, mm.
    pub fn worst(&self, positions: &[Vec3], now_ms: f64) -> Option<Vec3> {
        let most = self.sources.iter().max_by(|a, b| a.rate_at(now_ms).total_cmp(&b.rate_at(now_ms)))?;
        Some(self.middle(positions, most.face))
    }

    /// Sources that were closed by heat.
    pub fn coagulated(&self) -> u32 {
        self.coagulated
    }

    /// Whether [`save`](Self::save) takes everything: between two turns, when nothing flows.
    pub fn rests(&self) -> bool {
        self.part == 0 || self.last_ms == f64::INFINITY
    }

    /// Appends sources, burns, fluid and stains: at most 40 words a tetrahedron and one a node.
    pub fn save(&self, to: &mut Vec<u64>) {
        to.push(self.sources.len() as u64);
        for &Source { face, rate, since_ms, lasts_ms, heat_ms, due } in &self.sources {
            to.push(face.into());
            to.extend([rate.into(), since_ms, lasts_ms, heat_ms.into(), due.into()].map(f64::to_bits));
        }
        to.push(self.burnt.len() as u64);
        to.extend(self.burnt.iter().map(|face| u64::from(*face)));
        self.film.save(to);
        to.push(self.coagulated.into());
        to.extend(self.stains.iter().map(|stain| u64::from(*stain)));
    }

    /// Takes over what another wound of this mesh saved, of which the tetrahedra `gone` are
    /// missing; its times are `later_ms` later here. `None`, and no change, if it does not fit.
    pub fn restore(
        &mut self,
        words: &mut impl Iterator<Item = u64>,
        (gone, splits): (impl Iterator<Item = u32>, &[Split]),
        later_ms: f64,
    ) -> Option<()> {
        let faces = self.border.faces() as u64;
        let (mut sources, mut burnt, mut film) = (Vec::new(), Vec::new(), Film::on(&self.border));
        for _ in 0..words.next()? {
            let face = words.next().filter(|face| *face < faces)? as u32;
            let of = [(); 5].map(|()| words.next().map_or(f64::NAN, f64::from_bits));
            let [rate, since_ms, lasts_ms, heat_ms, due] = of.iter().all(|part| part.is_finite()).then_some(of)?;
            let [rate, heat_ms, due] = [rate, heat_ms, due].map(|part| part as f32);
            sources.push(Source { face, rate, since_ms: since_ms + later_ms, lasts_ms, heat_ms, due });
        }
        for _ in 0..words.next()? {
            burnt.push(words.next().filter(|face| *face < faces)? as u32);
        }
        film.restore(words)?;
        let coagulated = words.next()? as u32;
        let nodes = splits.iter().map(|split| split.node as usize + 1).fold(self.stains.len(), usize::max);
        let stains: Vec<u8> = words.take(nodes).map(|stain| stain as u8).collect();
        if stains.len() < nodes || sources.len().max(burnt.len()) > self.border.faces() {
            return None;
        }
        self.split(splits, None, 0.0);
        for face in gone.flat_map(|tet| self.border.remove(tet)).filter(|&face| face != NONE) {
            self.perfusion[face as usize / 4].vessel = 0.0;
        }
        self.sources.clone_from(&sources);
        self.burnt.clone_from(&burnt);
        (self.film, self.stains, self.coagulated) = (film, stains, coagulated);
        (self.part, self.last_ms) = (PARTS, f64::INFINITY);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_mesh::NONE;

    /// A bar of cubes of 2 mm, each of six tetrahedra, along x; its upper side is z = 2.
    fn bar(cubes: usize) -> TetMesh {
        const SPLIT: [[usize; 4]; 6] =
            [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let at = |i: usize| 2.0 * Vec3::new((i / 4) as f32, (i % 2) as f32, (i / 2 % 2) as f32);
        let corner = |cube: usize, c: usize| (4 * (cube + (c & 1)) + (c >> 1 & 1) + 2 * (c >> 2)) as u32;
        let tets = (0..cubes).flat_map(|cube| SPLIT.map(|split| split.map(|c| corner(cube, c)))).collect();
        TetMesh { positions: (0..4 * (cubes + 1)).map(at).collect(), tets }
    }

    const BRAIN: Perfusion = Perfusion { capillaries: 1.0, vessel: 0.0 };

    fn balance(wound: &Wound) {
        let (account, lies) = (wound.account(), wound.lies_pl());
        assert_eq!(account.came, [0, 1].map(|fluid| account.sucked[fluid] + lies[fluid]), "{account:?} {lies:?}");
    }

    /// One face of 2 mm² for 3.5 minutes: half the first rate times the time.
    #[test]
    fn a_capillary_bleeding_stops_by_itself_after_its_closed_form() {
        let mesh = bar(8);
        let mut wound = Wound::of(&mesh, &vec![BRAIN; mesh.tets.len()]);
        let none = Border::of(&mesh).remove(0).into_iter().filter(|&face| face != NONE).count();
        wound.remove(0, &mesh.positions, 0.0);
        let rate = wound.rate_ml_per_min(0.0);
        assert!(rate > 0.01 && none > 0, "{rate}");
        for ms in 0..=220_000 {
            wound.step(f64::from(ms), &mesh.positions, Vec3::Z, None);
        }
        let wanted = 0.5 * f64::from(rate) * bleeding::CAPILLARY_TIME.value * 1e9;
        assert!((wound.account().came[0] as f64 / wanted - 1.0).abs() < 1e-3, "{:?} {wanted}", wound.account());
        assert_eq!(wound.rate_ml_per_min(22e4), 0.0);
        balance(&wound);
    }

    #[test]
    fn heat_stops_a_vessel_rinsing_washes_and_suction_clears() {
        let mesh = bar(8);
        let cut = Perfusion { capillaries: 0.0, vessel: 1.0 };
        let mut wound = Wound::of(&mesh, &vec![cut; mesh.tets.len()]);
        wound.remove(30, &mesh.positions, 0.0);
        let (mut ms, positions) = (0.0, &mesh.positions);
        let place = wound.worst(positions, ms).unwrap();
        let mut run = |wound: &mut Wound, seconds: f64, act: Option<(Vec3, f32, Act)>| {
            for _ in 0..(seconds * 1e3) as u32 {
                ms += 1.0;
                wound.step(ms, positions, Vec3::Z, act);
            }
            ms
        };
        let now = run(&mut wound, 1.0, None);
        assert!(wound.rate_ml_per_min(now) > 5.0 && wound.stains().iter().any(|stain| *stain > 10));
        run(&mut wound, 1.0, Some((place + 40.0 * Vec3::Z, 1.0, Act::Coagulate)));
        assert_eq!((wound.coagulated(), wound.account().came[1]), (0, 0), "too far away");
        while wound.worst(positions, ms_of(&wound)).is_some() {
            let at = wound.worst(positions, ms_of(&wound)).unwrap();
            run(&mut wound, 1.1, Some((at, 1.0, Act::Coagulate)));
        }
        let now = run(&mut wound, 0.1, None);
        let came = wound.account().came;
        assert!(wound.rate_ml_per_min(now) == 0.0 && wound.coagulated() > 0 && came[1] > 0, "{came:?}");
        run(&mut wound, 5.0, None);
        assert_eq!(wound.account().came, came, "nothing bleeds any more");
        balance(&wound);
        for x in 0..17 {
            run(&mut wound, 0.3, Some((Vec3::new(x as f32, 1.0, 1.0), 1.5, Act::Suck)));
        }
        assert_eq!(wound.lies_pl(), [0; 2]);
        assert!(wound.stains().contains(&255), "a burn is seen where the blood is gone");
        balance(&wound);
    }

    fn ms_of(wound: &Wound) -> f64 {
        wound.last_ms
    }

    /// Everything goes in an order of chance, while tools work; the same again gives the same.
    #[test]
    fn volume_is_kept_to_the_picolitre_while_all_of_a_body_goes() {
        let operate = || {
            let mesh = bar(12);
            let perfusion = |tet: usize| Perfusion { capillaries: 1.5, vessel: f32::from(tet.is_multiple_of(5)) };
            let mut wound = Wound::of(&mesh, &(0..mesh.tets.len()).map(perfusion).collect::<Vec<_>>());
            let mut order: Vec<u32> = (0..mesh.tets.len() as u32).collect();
            order.sort_by_key(|tet| tet.wrapping_mul(2_654_435_761) % 1013);
            let mut ms = 0.0;
            for (turn, &tet) in order.iter().enumerate() {
                wound.remove(tet, &mesh.positions, ms);
                for step in 0..600 {
                    ms += 1.0;
                    let act = [Act::Suck, Act::Coagulate][turn % 2];
                    let tip = Vec3::new((turn % 24) as f32, 1.0, 2.0);
                    wound.step(ms, &mesh.positions, Vec3::Z, (step > 300 && turn % 3 > 0).then_some((tip, 1.0, act)));
                }
            }
            for _ in 0..20 {
                ms += 1.0;
                wound.step(ms, &mesh.positions, Vec3::Z, None);
                balance(&wound);
            }
            assert_eq!((wound.lies_pl(), wound.rate_ml_per_min(ms)), ([0; 2], 0.0));
            wound.account()
        };
        let account = operate();
        assert!(account.came.iter().all(|pl| *pl > 1_000_000), "{account:?}");
        assert_eq!(operate(), account);
    }

    /// A wound that bled for 3 s under forceps, taken over with another clock, is the same.
    #[test]
    fn a_wound_that_is_taken_over_goes_on_to_the_picolitre() {
        let (mesh, gone) = (bar(12), [30, 31, 32, 40]);
        let perfusion = vec![Perfusion { capillaries: 1.5, vessel: 1.0 }; mesh.tets.len()];
        let new = || Wound::of(&mesh, &perfusion);
        let (mut first, mut words, mut now) = (new(), Vec::new(), 0.0);
        gone.iter().for_each(|tet| first.remove(*tet, &mesh.positions, now));
        while now < 3000.0 || !first.rests() {
            now += 1.0;
            first.step(now, &mesh.positions, Vec3::Z, Some((Vec3::new(11.0, 1.0, 2.0), 1.0, Act::Coagulate)));
        }
        first.save(&mut words);
        let taken = |wound: &mut Wound, words: &[u64]| {
            wound.restore(&mut words.iter().copied(), (gone.into_iter(), &[]), 700.0)
        };
        let mut second = new();
        taken(&mut second, &words).unwrap();
        let state = |wound: &Wound, ms: f64| {
            (wound.account(), wound.lies_pl(), wound.stains().to_vec(), wound.coagulated(), wound.rate_ml_per_min(ms))
        };
        assert!(first.coagulated() > 0 && first.account().came[0] > 1_000_000);
        assert_eq!(state(&first, now), state(&second, now + 700.0));
        assert_eq!(first.perfusion, second.perfusion, "a vessel is cut once");
        for ms in 0..2000 {
            second.step(now + 700.0 + f64::from(ms), &mesh.positions, Vec3::Z, None);
            balance(&second);
        }
        let mut third = new();
        assert!((0..words.len()).all(|cut| taken(&mut third, &words[..cut]).is_none()));
        assert!(third.border.is_border(4 * 30) == Border::of(&mesh).is_border(4 * 30), "nothing changed");
        assert!(taken(&mut Wound::of(&bar(2), &perfusion), &words).is_none(), "another mesh");
    }
}
