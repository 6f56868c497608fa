//! Randomly damaged files for the tests of every reader.

use crate::{Import, ReadError};

/// Feeds mutated copies of valid files to a reader: it must not panic, and a volume must hold as
/// many samples as its sizes state.
///
/// `TREPAN_MUTATIONS` gives the number of executions; a few thousand by default.
pub(crate) fn survives_mutations(seeds: &[Vec<u8>], read: impl Fn(Vec<u8>) -> Result<Import, ReadError>) {
    let executions = std::env::var("TREPAN_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(3000);
    for seed in seeds {
        assert!(read(seed.clone()).is_ok(), "a whole file is read");
    }
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut read_well, mut longest) = (0, 0);
    for _ in 0..executions {
        let bytes = mutated(&seeds[random.below(seeds.len())], &mut random);
        let length = bytes.len();
        match read(bytes) {
            Ok(import) => {
                let volume = import.volume;
                assert_eq!(volume.data.len(), volume.dims.iter().product::<usize>());
                assert!(volume.data.len() <= 1100 * length, "{} voxels out of {length} bytes", volume.data.len());
                assert!(volume.world_from_voxel.matrix3.determinant().abs() > 0.0);
                read_well += 1;
            }
            Err(error) => longest = longest.max(error.to_string().len()),
        }
    }
    assert!(read_well < executions && longest < 2000, "{read_well} of {executions}, longest message {longest}");
}

fn mutated(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) {
        let length = bytes.len().max(1);
        let reach = if random.below(4) > 1 { 700 } else { length };
        let at = random.below(length.min(reach));
        match random.below(7) {
            0 => bytes.truncate(random.below(length)),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << random.below(8)),
            2 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b = random.below(256) as u8),
            3 => bytes.iter_mut().skip(at).take(1 + random.below(8)).for_each(|b| *b = 0xff),
            4 => bytes.iter_mut().skip(at).take(1 + random.below(8)).for_each(|b| *b = 0),
            5 => drop(bytes.drain(at.min(bytes.len())..(at + random.below(9)).min(bytes.len()))),
            _ => {
                let piece: Vec<u8> = bytes.iter().skip(random.below(length)).take(random.below(24)).copied().collect();
                bytes.splice(at.min(bytes.len())..at.min(bytes.len()), piece);
            }
        }
    }
    bytes
}

/// Xorshift (Marsaglia 2003) with a fixed seed.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % limit.max(1)
    }
}
