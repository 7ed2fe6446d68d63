//! What the models of a field and the estimates depend on: what is around a cell, how its prediction changes, and the coefficients
//! before one.

use surfabet_entropy::MixedContext;

/// Levels of the pyramid with models of their own, from the cells up.
pub(super) const LEVELS: usize = 12;

/// The same where a model depends on something else as well.
pub(super) const FEW_LEVELS: usize = 5;

/// Classes of how many coefficients are coded around a cell.
pub(super) const ACTIVITIES: usize = 7;

/// Classes of how much the prediction changes, without its sign.
pub(super) const CHANGES: usize = 7;

/// Classes of the sum of the sizes of coefficients before, each counted as 2 at most.
pub(super) const BEFORE: usize = 3;

/// Exponents with models of their own.
pub(super) const EXPONENTS: usize = 12;

/// Sizes, each counted as 2 at most, and signs of the coefficients of a cell along each axis, by channel; or sums of these over
/// some cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside<const N: usize> {
    sizes: [[u8; N]; 3],
    pub signs: [[i8; N]; 3],
    /// How many more coefficients of a channel have the sign of that of channel 0, or of channel 1, in the same butterfly than the
    /// other sign; only of channels after these.
    pub agreements: [[i8; N]; 2],
}

impl<const N: usize> Default for Beside<N> {
    fn default() -> Self {
        Self { sizes: [[0; N]; 3], signs: [[0; N]; 3], agreements: [[0; N]; 2] }
    }
}

impl<const N: usize> Beside<N> {
    /// What lies beside a cell across each axis: `below` are the cells one down along each, and what those along the
    /// other two axes have along an axis goes on in the cell. Of agreements the sum of all three.
    pub fn along(below: [Option<&Self>; 3]) -> Self {
        let mut sum = Self::default();
        for (b, other) in below.iter().enumerate() {
            let Some(other) = other else { continue };
            for c in 0..N {
                // 7 coefficients of three cells: 21.
                (0..2).for_each(|k| sum.agreements[k][c] += other.agreements[k][c]);
            }
            for axis in (0..3).filter(|&axis| axis != b) {
                for c in 0..N {
                    // At most 4 coefficients along an axis, of two cells: 16 and 8.
                    sum.sizes[axis][c] += other.sizes[axis][c];
                    sum.signs[axis][c] += other.signs[axis][c];
                }
            }
        }
        sum
    }

    /// Adds a coefficient; `others` are those of the same butterfly.
    fn add(&mut self, axis: usize, channel: usize, coefficient: i32, others: [i32; N]) {
        self.sizes[axis][channel] += coefficient.unsigned_abs().min(2) as u8;
        self.signs[axis][channel] += coefficient.signum() as i8;
        for (k, other) in others.iter().enumerate().take(channel.min(2)) {
            self.agreements[k][channel] += (other.signum() * coefficient.signum()) as i8;
        }
    }

    /// Class of the sizes, 0 to `most`.
    pub fn size(&self, axis: usize, channel: usize, most: u8) -> usize {
        usize::from(self.sizes[axis][channel].min(most))
    }

    /// Sum of the sizes of a channel.
    pub fn sum(&self, channel: usize) -> i32 {
        self.sizes.iter().map(|of_axis| i32::from(of_axis[channel])).sum()
    }

    /// Class of the signs, 0 to 4.
    fn sign(&self, axis: usize, channel: usize) -> usize {
        (self.signs[axis][channel].clamp(-2, 2) + 2) as usize
    }
}

/// What estimates depend on beside the models' contexts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around<const N: usize> {
    /// Activity of the cell at the level above.
    pub activity: u8,
    /// Sum of that of the cells that lie ahead, and of those beside that are coded.
    pub ahead: usize,
    pub behind: usize,
    /// Number of these.
    pub n_behind: usize,
    /// Cells of the first level in the cell.
    pub weight: u32,
    /// What was missed at the children of the cells beside that are coded, in eighths of a step, by channel.
    pub missed: [u64; N],
}

impl<const N: usize> Default for Around<N> {
    fn default() -> Self {
        Self { activity: 0, ahead: 0, behind: 0, n_behind: 0, weight: 0, missed: [0; N] }
    }
}

/// What the models of a cell depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellContext<const N: usize> {
    /// Level of the children in the pyramid.
    pub level: usize,
    parent: usize,
    around: usize,
    pub beside: Beside<N>,
    pub all: Around<N>,
    /// Number of coefficients per channel.
    pub n: usize,
    /// Axis of each coefficient, and the class of the weights of its two slots.
    pub axes: [usize; 7],
    pub weights: [u8; 7],
    /// How much the prediction changes where each coefficient is, with sign.
    pub changes: [[i8; N]; 7],
    /// How much what was missed beside the children differs there, with sign: its number of binary digits, in eighths of a
    /// step.
    pub pulls: [[i8; N]; 7],
}

impl<const N: usize> CellContext<N> {
    /// Context of a cell: what is around it, and what the cells beside it have which are coded already.
    pub fn new(level: usize, all: Around<N>, beside: Beside<N>) -> Self {
        let most = ACTIVITIES - 1;
        let parent = usize::from(all.activity) + all.ahead.div_ceil(2);
        Self {
            level: level.min(LEVELS - 1),
            parent: parent.min(most),
            around: all.behind.min(most),
            beside,
            all,
            n: 0,
            axes: [0; 7],
            weights: [0; 7],
            changes: [[0; N]; 7],
            pulls: [[0; N]; 7],
        }
    }

    /// Sets how much the prediction changes where a coefficient is.
    pub fn set_change(&mut self, i: usize, channel: usize, class: i8) {
        self.changes[i][channel] = class;
    }

    /// Sets the axis of coefficient i of n, and the class of the weights of its two slots.
    pub fn set_axis(&mut self, i: usize, axis: usize, weights: u8, n: usize) {
        self.axes[i] = axis;
        self.weights[i] = weights;
        self.n = n;
    }

    pub fn change(&self, i: usize, channel: usize) -> usize {
        usize::from(self.changes[i][channel].unsigned_abs())
    }

    /// Context of whether any coefficient of the cell is not zero.
    pub fn any(&self) -> MixedContext<2> {
        let largest = |channels: std::ops::Range<usize>| {
            let all = (0..self.n).flat_map(|i| channels.clone().map(move |c| self.change(i, c)));
            all.max().unwrap_or(0)
        };
        let activity = (self.level * ACTIVITIES + self.parent) * ACTIVITIES + self.around;
        let changes = (self.level * CHANGES + largest(0..1)) * CHANGES + largest(1..N);
        MixedContext { mixer: self.level, models: [activity, changes] }
    }
}

/// What the models of a coefficient depend on beside the cell: those of the cell before it.
pub(super) struct Before<const N: usize> {
    /// Sum of their sizes, each counted as 2 at most.
    pub size: u32,
    /// Sum of their sizes, by channel; at most 2^27.
    pub sizes: [u32; N],
    pub along: Beside<N>,
}

impl<const N: usize> Before<N> {
    pub fn new() -> Self {
        Self { size: 0, sizes: [0; N], along: Beside::default() }
    }

    /// Adds a coefficient; `others` are those of the same butterfly.
    pub fn add(&mut self, axis: usize, channel: usize, coefficient: i32, others: [i32; N]) {
        self.size += coefficient.unsigned_abs().min(2);
        self.sizes[channel] += coefficient.unsigned_abs();
        self.along.add(axis, channel, coefficient, others);
    }
}

/// The contexts of a coefficient.
pub(super) struct CoefficientContext {
    pub nonzero: MixedContext<5>,
    pub negative: MixedContext<3>,
    /// Of the first exponent; those of the next follow.
    exponent: MixedContext<2>,
}

impl CoefficientContext {
    /// Contexts of coefficient `i` of a channel; `others` are those of the same butterfly.
    pub fn new<const N: usize>(
        cell: &CellContext<N>,
        before: &Before<N>,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> Self {
        // Mixed radix: (digit, base), the first the most significant.
        let number = |digits: &[(usize, usize)]| {
            digits.iter().fold(channel, |all, &(digit, base)| all * base + digit)
        };
        let axis = cell.axes[i];
        let level = (cell.level, LEVELS);
        let few = |most: usize| (cell.level.min(most - 1), most);
        let size = (before.size.min(2) as usize, BEFORE);
        let change = cell.change(i, channel);
        // Channels before this one, at the same butterfly: luma, and the first of two chromas.
        let other = |c: usize| if c < channel { others[c] } else { 0 };
        let size_of = |c: usize| (other(c).unsigned_abs().min(2) as usize, 3);
        let sign_of = |c: usize| ((other(c).signum() + 1) as usize, 3);
        let nonzero = [
            number(&[level, size]),
            number(&[few(FEW_LEVELS), (axis, 3), (change, CHANGES)]),
            number(&[few(FEW_LEVELS), size_of(0), size_of(1), (before.size.min(3) as usize, 4)]),
            number(&[
                (axis, 3),
                (cell.beside.size(axis, channel, 4), 5),
                (before.along.size(axis, channel, 3), 4),
            ]),
            number(&[(cell.n - 1 - i, 7), (cell.n, 8), size]),
        ];
        let signed = (i32::from(cell.changes[i][channel]) + CHANGES as i32 - 1) as usize;
        let negative = [
            number(&[(signed, 2 * CHANGES - 1)]),
            number(&[sign_of(0), sign_of(1)]),
            number(&[(cell.beside.sign(axis, channel), 5), (before.along.sign(axis, channel), 5)]),
        ];
        let exponent = [
            number(&[level, size, (0, EXPONENTS)]),
            number(&[few(4), (change, CHANGES), (0, EXPONENTS)]),
        ];
        Self {
            nonzero: MixedContext { mixer: number(&[size]), models: nonzero },
            negative: MixedContext { mixer: channel, models: negative },
            exponent: MixedContext { mixer: number(&[(0, EXPONENTS)]), models: exponent },
        }
    }

    /// Context of whether the exponent is above `e`.
    pub fn exponent(&self, e: u32) -> MixedContext<2> {
        let e = (e as usize).min(EXPONENTS - 1);
        let MixedContext { mixer, models } = self.exponent;
        MixedContext { mixer: mixer + e, models: models.map(|of| of + e) }
    }
}
