//! Instances as binary decisions: places, boxes of whole blocks, and which of the patches in a box are given again.

use surfabet_entropy::{Bit, Coder, SInt, UInt};

use super::motion::{MAX_ANGLE, MAX_SHIFT};
use super::{Instance, Instances, Place};

/// Side of a block, finest pixels.
pub(super) const BLOCK: i32 = 16;

/// Largest coordinate of a block.
const MAX_BLOCK: i32 = 1 << 27;

/// The blocks that what a model codes lies in.
#[derive(Debug, Default)]
pub(in crate::patches) struct Blocks {
    /// Of each patch.
    pub patches: Vec<[i32; 3]>,
    /// Of each point beside them.
    pub points: Vec<[i32; 3]>,
}

/// A box of whole blocks.
#[derive(Debug, Clone, Copy)]
struct BlockBox {
    low: [i32; 3],
    /// Blocks along each axis.
    size: [u32; 3],
}

impl BlockBox {
    /// The box around some blocks; one block without any.
    fn around(blocks: &[[i32; 3]]) -> Self {
        let of = |a: usize| blocks.iter().map(move |block| block[a]);
        let low: [i32; 3] = std::array::from_fn(|a| of(a).min().unwrap_or(0));
        let size = std::array::from_fn(|a| {
            let high = of(a).max().unwrap_or(low[a]);
            (i64::from(high) - i64::from(low[a]) + 1) as u32
        });
        Self { low, size }
    }

    fn holds(&self, block: [i32; 3]) -> bool {
        (0..3).all(|a| {
            let from = i64::from(block[a]) - i64::from(self.low[a]);
            (0..i64::from(self.size[a])).contains(&from)
        })
    }
}

/// Every adaptive model of instances.
struct InstanceModels {
    angle: SInt,
    shift: [SInt; 3],
    low: [SInt; 3],
    size: [UInt; 3],
    /// Is a patch given again? By whether the one before in the box is.
    patch: [Bit; 2],
    /// Is a point? Likewise.
    point: [Bit; 2],
}

impl Default for InstanceModels {
    fn default() -> Self {
        Self {
            angle: SInt::new(),
            shift: [const { SInt::new() }; 3],
            low: [const { SInt::new() }; 3],
            size: [const { UInt::new() }; 3],
            patch: [const { Bit::new() }; 2],
            point: [const { Bit::new() }; 2],
        }
    }
}

/// Writes, reads or prices `count` instances of what lies in these `blocks`; when reading, none are `given`. A reader decides
/// about at most `limit` patches and points of all instances together.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::patches) fn code_instances<C: Coder>(
    coder: &mut C,
    given: &Instances,
    blocks: &Blocks,
    count: usize,
    limit: u64,
) -> Result<Instances, C::Error> {
    let mut found = Instances::default();
    if count == 0 {
        return Ok(found);
    }
    found.axis = coder.bypass(u64::from(given.axis), 2)? as u8;
    if found.axis > 2 {
        return Err(coder.corrupt("instances that turn about axis 3 of 0 to 2".into()));
    }
    let models = &mut InstanceModels::default();
    let none = Instance::default();
    let mut left = limit;
    for i in 0..count {
        let given = given.all.get(i).unwrap_or(&none);
        found.all.push(code_instance(coder, models, given, blocks, &mut left)?);
    }
    Ok(found)
}

/// Writes, reads or prices an instance; `left` patches and points may still be decided about.
fn code_instance<C: Coder>(
    coder: &mut C,
    models: &mut InstanceModels,
    given: &Instance,
    blocks: &Blocks,
    left: &mut u64,
) -> Result<Instance, C::Error> {
    let place = code_place(coder, models, given.place)?;
    let of_patches = given.patches.iter().map(|&i| blocks.patches[i as usize]);
    let of_points = given.points.iter().map(|&i| blocks.points[i as usize]);
    let of_given: Vec<[i32; 3]> = of_patches.chain(of_points).collect();
    let BlockBox { mut low, mut size } = BlockBox::around(&of_given);
    for a in 0..3 {
        low[a] = coder.sint(&mut models.low[a], low[a])?;
        size[a] = coder.uint(&mut models.size[a], size[a] - 1)?.saturating_add(1);
    }
    if low.iter().any(|c| c.unsigned_abs() > MAX_BLOCK as u32) {
        return Err(coder.corrupt(format!("an instance of blocks from {low:?}")));
    }
    let within = BlockBox { low, size };
    let of_patches = (&blocks.patches[..], within);
    let patches = code_kept(coder, &mut models.patch, &given.patches, of_patches, left)?;
    let of_points = (&blocks.points[..], within);
    let points = code_kept(coder, &mut models.point, &given.points, of_points, left)?;
    if patches.is_empty() {
        return Err(coder.corrupt("an instance without patches".into()));
    }
    Ok(Instance { place, patches, points })
}

/// Writes, reads or prices where an instance stands.
fn code_place<C: Coder>(
    coder: &mut C,
    models: &mut InstanceModels,
    given: Place,
) -> Result<Place, C::Error> {
    let quarters = coder.bypass(u64::from(given.quarters), 2)? as u8;
    let mirrored = coder.bypass(u64::from(given.mirrored), 1)? != 0;
    let angle = coder.sint(&mut models.angle, given.angle)?;
    let mut shift = given.shift;
    for (model, c) in models.shift.iter_mut().zip(&mut shift) {
        *c = coder.sint(model, *c)?;
    }
    let is_far = shift.iter().any(|c| c.unsigned_abs() > MAX_SHIFT as u32);
    if is_far || angle.unsigned_abs() > MAX_ANGLE as u32 {
        return Err(coder.corrupt(format!("an instance shifted by {shift:?}, turned by {angle}")));
    }
    Ok(Place { mirrored, quarters, angle, shift })
}

/// Writes, reads or prices which of the patches or points in a box are given again.
fn code_kept<C: Coder>(
    coder: &mut C,
    models: &mut [Bit; 2],
    given: &[u32],
    (blocks, within): (&[[i32; 3]], BlockBox),
    left: &mut u64,
) -> Result<Vec<u32>, C::Error> {
    let mut kept = Vec::new();
    let mut given = given.iter().copied().peekable();
    let mut before = true;
    for (i, _) in (0..).zip(blocks).filter(|&(_, &block)| within.holds(block)) {
        if *left == 0 {
            return Err(
                coder.corrupt("more patches and points of instances than the limits allow".into())
            );
        }
        *left -= 1;
        let is_given = given.next_if_eq(&i).is_some();
        before = coder.bit(&mut models[usize::from(before)], is_given)?;
        if before {
            kept.push(i);
        }
    }
    Ok(kept)
}
