//! What a program cannot know: signals, numbers typed in, whether an error or an interrupt comes, where the robot is.

use super::value::{Frame, Val};

/// Numbers in the same order for the same seed; readings of the robot's place are played back to the corrected program.
#[derive(Clone)]
pub struct Oracle {
    state: u64,
    /// Where the robot stood, in the order of the calls.
    pub places: Vec<Val>,
    next: usize,
    playing: bool,
}

impl Oracle {
    pub fn new(seed: u64) -> Self {
        Self {
            state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03,
            places: Vec::new(),
            next: 0,
            playing: false,
        }
    }

    /// The same inputs once more, with the places that the first run read.
    pub fn again(seed: u64, first: &Self) -> Self {
        Self { places: first.places.clone(), playing: true, ..Self::new(seed) }
    }

    /// SplitMix64.
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    pub fn one_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    pub fn signal(&mut self) -> f64 {
        if self.below(2) == 0 { 0.0 } else { 1.0 }
    }

    pub fn number(&mut self) -> f64 {
        1.0 + self.below(3) as f64
    }

    pub fn frame(&mut self) -> Frame {
        let shift: [f64; 3] = std::array::from_fn(|_| self.below(60) as f64 - 30.0);
        let angle = self.below(40) as f64 - 20.0;
        Frame::shift(shift).then(&Frame::turn(2, angle))
    }

    /// A reading of the robot's place: recorded in the first run, played back in the second.
    pub fn place(&mut self, now: impl FnOnce(&mut Self) -> Val) -> Val {
        if self.playing {
            self.next += 1;
            if let Some(place) = self.places.get(self.next - 1) {
                return place.clone();
            }
        }
        let place = now(self);
        self.places.push(place.clone());
        place
    }
}
