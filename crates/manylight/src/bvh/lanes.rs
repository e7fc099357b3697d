//! Eight numbers at once: plain arrays, or AVX registers.
//!
//! Both round alike: each operation is one IEEE operation per lane, and nothing is fused.

use super::pack::Lanes;
use std::ops::{Add, Div, Mul, Sub};

/// Eight numbers.
pub(super) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Proof that the processor has them.
    type Found: Copy;
    fn splat(found: Self::Found, value: f32) -> Self;
    fn load(found: Self::Found, lanes: &Lanes) -> Self;
    fn to_lanes(self) -> Lanes;
    /// The lesser of each lane; `other` where one is NaN.
    fn min(self, other: Self) -> Self;
    /// The greater of each lane; `other` where one is NaN.
    fn max(self, other: Self) -> Self;
    /// Bits of the lanes that are not greater; false for NaN.
    fn le(self, other: Self) -> u32;
    /// Bits of the lanes that are less; false for NaN.
    fn lt(self, other: Self) -> u32;
}

/// Lanes for every processor.
#[derive(Clone, Copy)]
pub(super) struct Plain(Lanes);

#[inline(always)]
fn zip(a: Plain, b: Plain, f: impl Fn(f32, f32) -> f32) -> Plain {
    Plain(std::array::from_fn(|i| f(a.0[i], b.0[i])))
}

#[inline(always)]
fn bits(a: Plain, b: Plain, f: impl Fn(f32, f32) -> bool) -> u32 {
    (0..a.0.len()).fold(0, |mask, i| mask | u32::from(f(a.0[i], b.0[i])) << i)
}

impl Vector for Plain {
    type Found = ();
    #[inline(always)]
    fn splat((): (), value: f32) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn load((): (), lanes: &Lanes) -> Self {
        Self(*lanes)
    }
    #[inline(always)]
    fn to_lanes(self) -> Lanes {
        self.0
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        zip(self, other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        zip(self, other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        bits(self, other, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        bits(self, other, |a, b| a < b)
    }
}

/// Proof that this processor has AVX2, and with it AVX.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(super) struct Avx2(());

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    /// Asks the processor.
    #[inline(always)]
    pub fn find() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

/// One AVX register. The first ones are made of an [`Avx2`], all others of those.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(super) struct Avx(std::arch::x86_64::__m256);

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::{Add, Avx, Avx2, Div, Lanes, Mul, Sub, Vector};
    use std::arch::x86_64::*;

    impl Vector for Avx {
        type Found = Avx2;
        #[inline(always)]
        fn splat(_: Avx2, value: f32) -> Self {
            // SAFETY: the processor has AVX, as the proof says.
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn load(_: Avx2, lanes: &Lanes) -> Self {
            // SAFETY: as above; eight numbers may be read.
            Self(unsafe { _mm256_loadu_ps(lanes.as_ptr()) })
        }
        #[inline(always)]
        fn to_lanes(self) -> Lanes {
            // SAFETY: a register is eight numbers.
            unsafe { std::mem::transmute(self.0) }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: the processor has AVX, see `Avx`.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: the processor has AVX, see `Avx`.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn le(self, other: Self) -> u32 {
            // SAFETY: the processor has AVX, see `Avx`.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
        }
        #[inline(always)]
        fn lt(self, other: Self) -> u32 {
            // SAFETY: the processor has AVX, see `Avx`.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }
    }

    macro_rules! operators {
        ($($name:ident, $function:ident, $avx:ident;)*) => { $(
            impl $name for Avx {
                type Output = Self;
                #[inline(always)]
                fn $function(self, other: Self) -> Self {
                    // SAFETY: the processor has AVX, see `Avx`.
                    Self(unsafe { $avx(self.0, other.0) })
                }
            }
        )* };
    }
    operators! {
        Add, add, _mm256_add_ps;
        Sub, sub, _mm256_sub_ps;
        Mul, mul, _mm256_mul_ps;
        Div, div, _mm256_div_ps;
    }
}

macro_rules! plain_operators {
    ($($name:ident, $function:ident, $op:tt;)*) => { $(
        impl $name for Plain {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                zip(self, other, |a, b| a $op b)
            }
        }
    )* };
}
plain_operators! { Add, add, +; Sub, sub, -; Mul, mul, *; Div, div, /; }
