//! The picture as eight bits of a screen, on the graphics device.
//!
//! In: the picture, exposure · Out: sRGB codes
//! Limits: automatic exposure counts luminances in steps of 1/64 stop.

use super::gpu::LIST_CONSTANTS;
use crate::error::Error;
use crate::gpu::{Buf, Constant, GROUP, Gpu, KernelInfo, Recorder, Value, kernel, record};

/// Stop of the least luminance that counts for automatic exposure, 2^−128.
const LEAST_STOP: f32 = -128.0;
/// Steps of luminances in a stop.
const STEPS_PER_STOP: u32 = 64;
/// Steps from the least luminance to the greatest, 2^128.
const STEPS: u32 = 256 * STEPS_PER_STOP;
/// One of so many pixels is left out at the dark, and one at the bright end.
const TRIM_PARTS: u32 = 10;
/// Stop of the luminance that automatic exposure maps the log-average to, log2 of 0.18.
const MIDDLE_GREY_STOP: f32 = -2.473_931;
/// Most stops that automatic exposure moves.
const MAX_EV: f32 = 24.0;

const STEP_CONSTANTS: &[Constant] = &[
    Constant { name: "LEAST_STOP", value: Value::F32(LEAST_STOP) },
    Constant { name: "STEPS_PER_STOP", value: Value::F32(STEPS_PER_STOP as f32) },
    Constant { name: "STEPS", value: Value::U32(STEPS) },
];
const EXPOSURE_CONSTANTS: &[Constant] = &[
    Constant { name: "TRIM_PARTS", value: Value::U32(TRIM_PARTS) },
    Constant { name: "MIDDLE_GREY_STOP", value: Value::F32(MIDDLE_GREY_STOP) },
    Constant { name: "MAX_EV", value: Value::F32(MAX_EV) },
];

record! {
    /// How much light is amplified.
    pub struct Exposure {
        /// Stops.
        pub ev: f32,
        /// The factor that they are.
        pub scale: f32,
    }
}

record! {
    /// What counting luminances needs.
    pub struct CountParams {
        /// Pixels.
        pub pixels: u32,
    }
}

record! {
    /// What the curve needs.
    pub struct ToneParams {
        /// Pixels.
        pub pixels: u32,
        /// Whether the exposure is the one found on the device.
        pub is_auto: u32,
        /// Else the factor that it is.
        pub scale: f32,
    }
}

kernel! {
    /// Luminances.
    struct CountLuminances = "composite/exposure_count", [GROUP, 1, 1],
        [LIST_CONSTANTS, STEP_CONSTANTS];
    uniform params: CountParams, read beauty: [f32; 4], write histogram: u32
}

kernel! {
    /// Automatic exposure.
    struct Expose = "composite/exposure", [GROUP, 1, 1], [STEP_CONSTANTS, EXPOSURE_CONSTANTS];
    write histogram: u32, write exposure: Exposure
}

kernel! {
    /// Codes.
    struct ToneMap = "composite/tone", [GROUP, 1, 1], [LIST_CONSTANTS];
    uniform params: ToneParams, shared exposure: Exposure, read beauty: [f32; 4],
    write codes: u32
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] = &[&CountLuminances::INFO, &Expose::INFO, &ToneMap::INFO];

/// The tone curve for pictures of one size: what `manylight-image` writes into a PNG.
#[derive(Debug)]
pub struct Tone {
    /// A pixel each, row-major from the top: red in the lowest byte, green, blue, 255.
    pub codes: Buf<u32>,
    /// The last automatic exposure, one record.
    pub exposure: Buf<Exposure>,
    /// Pixels per step of luminance, zero between frames.
    histogram: Buf<u32>,
}

impl Tone {
    /// Room for a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(gpu: &Gpu, width: usize, height: usize) -> Result<Self, Error> {
        Ok(Self {
            codes: gpu.buffer("codes", width * height)?,
            exposure: gpu.buffer("exposure", 1)?,
            histogram: gpu.buffer("luminances", STEPS as usize)?,
        })
    }

    /// Makes the codes of a picture; without an exposure, EV, by the automatic one.
    pub fn record(&self, rec: &mut Recorder<'_>, beauty: &Buf<[f32; 4]>, exposure_ev: Option<f32>) {
        let pixels = self.codes.len();
        if exposure_ev.is_none() {
            let params = rec.uniform(&CountParams { pixels: pixels as u32 });
            let histogram = &self.histogram;
            rec.dispatch_items(&CountLuminances { params, beauty, histogram }, pixels);
            rec.dispatch(&Expose { histogram, exposure: &self.exposure }, [1, 1, 1]);
        }
        let is_auto = u32::from(exposure_ev.is_none());
        let ev = exposure_ev.filter(|ev| !ev.is_nan()).unwrap_or(0.0);
        let params = ToneParams { pixels: pixels as u32, is_auto, scale: ev.exp2() };
        let kernel = ToneMap {
            params: rec.uniform(&params),
            exposure: &self.exposure,
            beauty,
            codes: &self.codes,
        };
        rec.dispatch_items(&kernel, pixels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::{check_kernel, device};
    use crate::math::{hash_u32, unit_f32};
    use manylight_image::{Raster, ToneSettings, compute_auto_exposure_ev, tone_map};

    #[test]
    fn kernels_match_their_shaders() {
        KERNELS.iter().for_each(|kernel| check_kernel(kernel));
    }

    #[test]
    fn middle_grey_is_where_the_specification_has_it() {
        assert_eq!(MIDDLE_GREY_STOP, 0.18f64.log2() as f32);
    }

    /// Codes and exposure of a picture by the device.
    fn run(gpu: &Gpu, raster: &Raster, exposure_ev: Option<f32>) -> (Vec<[u8; 4]>, f32) {
        let tone = Tone::new(gpu, raster.width, raster.height).expect("tone");
        let pixels: Vec<_> = raster.data.chunks_exact(3).map(|p| [p[0], p[1], p[2], 1.0]).collect();
        let beauty = gpu.upload("picture", &pixels).expect("picture");
        // Twice, as a second frame finds what the first left.
        for _ in 0..2 {
            let mut rec = gpu.record(None);
            tone.record(&mut rec, &beauty, exposure_ev);
            rec.submit().wait().expect("done");
        }
        let codes = gpu.read(&tone.codes, pixels.len()).expect("codes");
        let exposure = gpu.read(&tone.exposure, 1).expect("exposure")[0];
        (codes.into_iter().map(u32::to_le_bytes).collect(), exposure.ev)
    }

    fn assert_alike(gpu: &Gpu, raster: &Raster, exposure_ev: Option<f32>) {
        let settings = ToneSettings { exposure_ev, ..ToneSettings::default() };
        let expected = tone_map(raster, &settings).expect("a raster");
        let (found, ev) = run(gpu, raster, exposure_ev);
        if exposure_ev.is_none() {
            let expected = compute_auto_exposure_ev(raster);
            assert!((ev - expected).abs() < 0.01, "{ev} EV for {expected}");
        }
        for (i, (a, b)) in expected.chunks_exact(3).zip(&found).enumerate() {
            let off = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(off <= Some(1) && b[3] == 255, "pixel {i}: {a:?} and {b:?}");
        }
    }

    /// Colors over some stops around a luminance.
    fn picture(stops: f32, middle: f32) -> Raster {
        let mut raster = Raster::new(61, 43, 3);
        for (i, value) in raster.data.iter_mut().enumerate() {
            let stop = (unit_f32(hash_u32(i as u32)) - 0.5) * stops;
            *value = middle * stop.exp2();
        }
        raster
    }

    #[test]
    fn codes_are_those_of_a_png() {
        let Some(gpu) = device() else { return };
        for (stops, middle) in [(20.0, 0.18), (3.0, 40.0), (0.0, 0.3), (8.0, 1e-6)] {
            let raster = picture(stops, middle);
            for exposure_ev in [Some(0.0), Some(-3.7), Some(20.0), Some(f32::NAN), None] {
                assert_alike(gpu, &raster, exposure_ev);
            }
        }
    }

    #[test]
    fn odd_values_have_the_codes_of_a_png() {
        let Some(gpu) = device() else { return };
        let mut raster = picture(6.0, 0.5);
        let odd = [f32::NAN, -1.0, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 0.0, 1e-42, -0.0];
        for (i, value) in raster.data.iter_mut().enumerate().filter(|(i, _)| i % 5 == 0) {
            *value = odd[i / 5 % odd.len()];
        }
        for exposure_ev in [Some(0.0), Some(30.0), Some(-30.0), None] {
            assert_alike(gpu, &raster, exposure_ev);
        }
        for value in odd {
            let data = vec![value; 3];
            let one = Raster { width: 1, height: 1, channels: 3, data };
            assert_alike(gpu, &one, None);
        }
    }

    #[test]
    fn automatic_exposure_leaves_out_the_ends() {
        let Some(gpu) = device() else { return };
        let mut raster = Raster::new(100, 7, 3);
        raster.data.fill(0.36);
        raster.data[..600].fill(0.0);
        raster.data[600..700].fill(1e6);
        assert_alike(gpu, &raster, None);
        assert_eq!(run(gpu, &raster, None), run(gpu, &raster, None));
    }
}
