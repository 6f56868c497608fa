//! Blood and saline on border triangles.

use crate::border::Border;
use trepan_geometry::Vec3;
use trepan_measurements::bleeding;
use trepan_mesh::NONE;

/// Picolitres in a mm³.
pub(crate) const PL: f32 = 1e6;
/// Acceleration of gravity, mm/ms².
const GRAVITY: f32 = trepan_geometry::units::GRAVITY_MM_PER_MS2;
/// Film that sticks, mm.
const RESIDUE_MM: f32 = bleeding::RESIDUE.f32();
/// Most of a fluid on a face, pl: a litre, so that sums fit; numerical.
const MOST_PL: u64 = 1_000_000_000_000;
/// Least share of a triangle's area that counts as seen from above, numerical: walls are no lines.
const STEEPEST: f32 = 0.2;
/// Share of what levels a pair out that flows in a step: three edges, numerical.
const LEVELS: f32 = 1.0 / 3.0;

/// Blood and saline on the border, pl.
pub struct Film {
    /// Of each face.
    volumes: Vec<[u64; 2]>,
    changes: Vec<[i64; 2]>,
    /// Faces with something on them, and whether each is listed.
    wet: Vec<u32>,
    is_wet: Vec<bool>,
    /// How many of them flow in this turn.
    turn: usize,
    account: Account,
}

/// Where blood and saline came from and went, pl each; blood first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// What came: blood that bled, saline that rinsed.
    pub came: [u64; 2],
    /// What was sucked away.
    pub sucked: [u64; 2],
}

/// A triangle as the film sees it.
struct Place {
    middle: Vec3,
    area_mm2: f32,
    /// As seen from above, mm².
    level_mm2: f32,
    corners: [Vec3; 3],
}

impl Film {
    /// A dry border.
    pub fn on(border: &Border) -> Self {
        let faces = border.faces();
        Self {
            volumes: vec![[0; 2]; faces],
            changes: vec![[0; 2]; faces],
            wet: Vec::with_capacity(faces),
            is_wet: vec![false; faces],
            turn: 0,
            account: Account::default(),
        }
    }

    /// Blood and saline of a face, pl.
    pub fn volumes_pl(&self, face: u32) -> [u64; 2] {
        self.volumes[face as usize]
    }

    /// Faces with something on them.
    pub fn wet(&self) -> &[u32] {
        &self.wet
    }

    /// Where everything came from and went.
    pub fn account(&self) -> Account {
        self.account
    }

    /// All that lies on the border, pl.
    pub fn lies_pl(&self) -> [u64; 2] {
        [0, 1].map(|fluid| self.wet.iter().map(|&face| self.volumes[face as usize][fluid]).sum())
    }

    /// Adds blood and saline to a face.
    pub fn pour(&mut self, face: u32, pl: [u64; 2]) {
        let added = self.add(face, pl.map(|pl| pl as i64));
        (0..2).for_each(|fluid| self.account.came[fluid] += added[fluid].unsigned_abs());
    }

    /// Sucks at most a volume from a face, of both fluids alike; returns how much.
    pub fn suck(&mut self, face: u32, most_pl: u64) -> u64 {
        let there = self.volumes[face as usize];
        let all = there[0] + there[1];
        let taken = if most_pl >= all { there } else { shares(there, most_pl) };
        self.add(face, taken.map(|pl| -(pl as i64)));
        (0..2).for_each(|fluid| self.account.sucked[fluid] += taken[fluid]);
        taken[0] + taken[1]
    }

    /// Moves what lies on a face that went to those that came to light; to the suction where there
    /// is none.
    pub fn leave(&mut self, face: u32, exposed: [u32; 4]) {
        let to = exposed.into_iter().find(|&other| other != NONE);
        let pl = self.volumes[face as usize];
        match to {
            Some(to) => {
                self.add(face, pl.map(|pl| -(pl as i64)));
                self.add(to, pl.map(|pl| pl as i64));
            }
            None => {
                self.suck(face, u64::MAX);
            }
        }
    }

    /// Changes a face's volumes, as far as there is room; returns by how much.
    fn add(&mut self, face: u32, pl: [i64; 2]) -> [i64; 2] {
        let volumes = &mut self.volumes[face as usize];
        let before = *volumes;
        *volumes = [0, 1].map(|fluid| before[fluid].saturating_add_signed(pl[fluid]).min(MOST_PL));
        let after = *volumes;
        if !std::mem::replace(&mut self.is_wet[face as usize], true) {
            self.wet.push(face);
        }
        [0, 1].map(|fluid| after[fluid] as i64 - before[fluid] as i64)
    }

    /// Finds what flows in a time, for one of `of` parts of the faces; [`settle`](Self::settle)
    /// moves it. Between the first part and that nothing may be poured, sucked or taken away.
    pub fn flow(&mut self, border: &Border, positions: &[Vec3], up: Vec3, dt_ms: f32, [part, of]: [usize; 2]) {
        if part == 0 {
            self.turn = self.wet.len();
        }
        for at in (part..self.turn).step_by(of) {
            let face = self.wet[at];
            let there = self.volumes[face as usize];
            let here = Place::of(border, positions, up, face);
            let (depth_mm, mobile_mm) = (here.depth_mm(there), here.film_mm(there) - RESIDUE_MM);
            if mobile_mm.is_nan() || mobile_mm <= 0.0 {
                continue;
            }
            let mut moved = [0u64; 2];
            for (edge, other) in border.beside(face).into_iter().enumerate().filter(|(_, other)| *other != NONE) {
                let next = Place::of(border, positions, up, other);
                let fall_mm =
                    (here.middle - next.middle).dot(up) + depth_mm - next.depth_mm(self.volumes[other as usize]);
                let flux = here.flux(&next, edge, fall_mm, mobile_mm) * dt_ms;
                let levels = LEVELS * fall_mm * here.level_mm2 * next.level_mm2 / (here.level_mm2 + next.level_mm2);
                let mobile = LEVELS * mobile_mm * here.area_mm2;
                let pl = PL * flux.min(levels).min(mobile);
                if !fall_mm.is_finite() || pl.is_nan() || pl < 1.0 {
                    continue;
                }
                let flows = shares(there, (pl as u64).min(there[0] + there[1]));
                for fluid in 0..2 {
                    let pl = flows[fluid].min(there[fluid] - moved[fluid]);
                    moved[fluid] += pl;
                    self.changes[face as usize][fluid] -= pl as i64;
                    self.changes[other as usize][fluid] += pl as i64;
                }
                if !std::mem::replace(&mut self.is_wet[other as usize], true) {
                    self.wet.push(other);
                }
            }
        }
    }

    /// Moves what flows.
    pub fn settle(&mut self) {
        for &face in &self.wet {
            let changes = std::mem::take(&mut self.changes[face as usize]);
            let volumes = &mut self.volumes[face as usize];
            *volumes = [0, 1].map(|fluid| volumes[fluid].saturating_add_signed(changes[fluid]));
        }
        let (volumes, is_wet) = (&self.volumes, &mut self.is_wet);
        self.wet.retain(|&face| {
            is_wet[face as usize] = volumes[face as usize] != [0; 2];
            is_wet[face as usize]
        });
    }

    /// Appends what lies where, and the account.
    pub(crate) fn save(&self, to: &mut Vec<u64>) {
        to.push(self.wet.len() as u64);
        for &face in &self.wet {
            let [blood, saline] = self.volumes[face as usize];
            to.extend([face.into(), blood, saline]);
        }
        to.extend(self.account.came);
        to.extend(self.account.sucked);
    }

    /// Takes that over on a dry border, to the picolitre; `None` if it does not fit or balance.
    pub(crate) fn restore(&mut self, words: &mut impl Iterator<Item = u64>) -> Option<()> {
        for _ in 0..words.next()? {
            let face = words.next().filter(|face| *face < self.volumes.len() as u64)? as u32;
            let pl = [words.next()?, words.next()?];
            let is_new = !std::mem::replace(&mut self.is_wet[face as usize], true);
            self.volumes[face as usize] = pl;
            self.wet.push((is_new && pl.iter().all(|pl| *pl <= MOST_PL)).then_some(face)?);
        }
        self.account.came = [words.next()?, words.next()?];
        self.account.sucked = [words.next()?, words.next()?];
        let lies = self.lies_pl();
        (0..2)
            .all(|fluid| lies[fluid].checked_add(self.account.sucked[fluid]) == Some(self.account.came[fluid]))
            .then_some(())
    }

    /// Thickness of the blood on a face, mm.
    pub fn blood_mm(&self, border: &Border, positions: &[Vec3], face: u32) -> f32 {
        Place::of(border, positions, Vec3::Z, face).film_mm([self.volumes[face as usize][0], 0])
    }
}

impl Place {
    fn of(border: &Border, positions: &[Vec3], up: Vec3, face: u32) -> Self {
        let corners = border.nodes(face).map(|node| positions[node as usize]);
        let twice_area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let area_mm2 = 0.5 * twice_area.length().max(f32::MIN_POSITIVE);
        let level_mm2 = (0.5 * twice_area.dot(up).abs()).max(STEEPEST * area_mm2);
        Self { middle: (corners[0] + corners[1] + corners[2]) / 3.0, area_mm2, level_mm2, corners }
    }

    /// Depth of the fluid from above, mm.
    fn depth_mm(&self, pl: [u64; 2]) -> f32 {
        (pl[0] as f32 + pl[1] as f32) / (PL * self.level_mm2)
    }

    /// Thickness of the film, mm.
    fn film_mm(&self, pl: [u64; 2]) -> f32 {
        (pl[0] as f32 + pl[1] as f32) / (PL * self.area_mm2)
    }

    /// Flux across an edge, mm³/ms.
    fn flux(&self, next: &Self, edge: usize, fall_mm: f32, mobile_mm: f32) -> f32 {
        let mobility = bleeding::DENSITY.f32() * 1e-3 * GRAVITY / (3.0 * bleeding::VISCOSITY.f32() * 1e-6);
        let length_mm = self.corners[edge].distance(self.corners[(edge + 1) % 3]);
        let apart_mm = self.middle.distance(next.middle).max(0.1 * length_mm).max(f32::MIN_POSITIVE);
        mobility * mobile_mm.powi(3) * fall_mm / apart_mm * length_mm
    }
}

/// Shares of two volumes in a part of their sum, exactly that part.
fn shares(there: [u64; 2], part: u64) -> [u64; 2] {
    let all = u128::from(there[0] + there[1]);
    let first = (u128::from(part) * u128::from(there[0])).checked_div(all).unwrap_or(0) as u64;
    [first, part - first]
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_mesh::TetMesh;

    /// A plate of tetrahedra, `cells` long and wide, 1 thick, edges 1 mm; its upper face is z = 1.
    fn plate(cells: [usize; 2]) -> TetMesh {
        const SPLIT: [[usize; 4]; 6] =
            [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let (nx, ny) = (cells[0] + 1, cells[1] + 1);
        let at = |i: usize| Vec3::new((i % nx) as f32, (i / nx % ny) as f32, (i / nx / ny) as f32);
        let corner = |cell: usize, c: usize| {
            let (x, y, z) = (cell % cells[0] + (c & 1), cell / cells[0] + (c >> 1 & 1), c >> 2);
            (x + nx * (y + ny * z)) as u32
        };
        let tets = (0..cells[0] * cells[1]).flat_map(|cell| SPLIT.map(|s| s.map(|c| corner(cell, c)))).collect();
        TetMesh { positions: (0..2 * nx * ny).map(at).collect(), tets }
    }

    /// Upper faces of a plate, and the middle of each.
    fn upper(border: &Border, mesh: &TetMesh) -> Vec<(u32, Vec3)> {
        let corners = |face: u32| border.nodes(face).map(|node| mesh.positions[node as usize]);
        let is_upper = |face: &u32| border.is_border(*face) && corners(*face).iter().all(|p| p.z == 1.0);
        (0..border.faces() as u32).filter(is_upper).map(|f| (f, corners(f).into_iter().sum::<Vec3>() / 3.0)).collect()
    }

    /// The film of a wetted plate that is stood up thins as the root of x over t.
    ///
    /// Source: H. Jeffreys, The draining of a vertical plate, Proc. Camb. Phil. Soc. 26 (1930).
    #[test]
    fn a_plate_drains_as_jeffreys_found() {
        let mesh = plate([40, 24]);
        let border = Border::of(&mesh);
        let (mut film, faces) = (Film::on(&border), upper(&border, &mesh));
        let up = Vec3::new(-0.5, 0.0, 0.75f32.sqrt());
        faces.iter().for_each(|&(face, _)| film.pour(face, [200_000, 50_000]));
        let (poured, dt_ms, steps) = (film.lies_pl(), 2.0, 2000);
        (0..steps).for_each(|_| {
            film.flow(&border, &mesh.positions, up, dt_ms, [0, 1]);
            film.settle();
        });
        assert_eq!(film.lies_pl(), poured, "nothing is lost");
        let (density, viscosity) = (1.06e-3, 3.5e-6);
        for x in [12.0, 20.0, 28.0] {
            let truth = (viscosity * x / (density * GRAVITY * 0.5 * dt_ms * steps as f32)).sqrt();
            let near: Vec<_> =
                faces.iter().filter(|(_, p)| (p.x - x).abs() < 1.5 && (p.y - 12.0).abs() < 2.1).collect();
            let all: f32 = near.iter().map(|(face, _)| film.volumes_pl(*face).iter().sum::<u64>() as f32).sum();
            let film_mm = all / (PL * 0.5 * near.len() as f32) - RESIDUE_MM;
            assert!((film_mm / truth - 1.0).abs() < 0.05, "{film_mm} mm at {x}, {truth} wanted");
        }
    }

    #[test]
    fn a_pit_fills_level_from_its_bottom() {
        let mut mesh = plate([20, 20]);
        // A bowl, 4 mm deep.
        mesh.positions.iter_mut().for_each(|p| {
            let away = ((p.x - 10.0).powi(2) + (p.y - 10.0).powi(2)).sqrt();
            p.z += 0.05 * away * away;
        });
        let border = Border::of(&mesh);
        let mut film = Film::on(&border);
        let flat = plate([20, 20]);
        let faces = upper(&border, &flat);
        let rim = faces.iter().find(|(_, p)| p.distance(Vec3::new(15.0, 10.0, 1.0)) < 0.6).unwrap().0;
        for _ in 0..3000 {
            if film.account().came[0] < 60_000_000 {
                film.pour(rim, [100_000, 0]);
            }
            (0..3).for_each(|part| film.flow(&border, &mesh.positions, Vec3::Z, 10.0, [part, 3]));
            film.settle();
        }
        let level = |face: u32| {
            let place = Place::of(&border, &mesh.positions, Vec3::Z, face);
            (place.depth_mm(film.volumes_pl(face)), place.middle.z + place.depth_mm(film.volumes_pl(face)))
        };
        // Volume of a paraboloid z = r²/20: π h² · 10.
        let wanted = 1.0 + (60.0f32 / (10.0 * std::f32::consts::PI)).sqrt();
        let pool: Vec<f32> =
            faces.iter().map(|&(face, _)| level(face)).filter(|(d, _)| *d > 0.3).map(|l| l.1).collect();
        assert!(pool.len() > 40, "{}", pool.len());
        for level in pool {
            assert!((level - wanted).abs() < 0.12, "{level}, {wanted} wanted");
        }
    }
}
