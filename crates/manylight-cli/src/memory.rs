//! Whether a render fits into the memory of this machine.
//!
//! In: size and settings · Out: an error instead of a program killed half-way.
//! Limits: scenes are not counted; what the system does not tell is taken as enough.

use crate::Failure;
use manylight::Settings;

/// Bytes that a pixel takes at the peak: receivers, layers, and the picture to be written.
///
/// A fifth more than the growth of the peak resident size with the size of the picture: 335 B from
/// 320² to 1024² pixels of builtin:cornell, 342 B to 1280² of Sponza with its EXR file.
const BYTES_PER_PIXEL: u64 = 410;
/// Bytes that a pixel takes beside them where frames add up (`filter.temporal`).
///
/// A fifth more than 196 B, by which its growth from 320² to 1024² pixels of builtin:atrium is
/// larger than without.
const BYTES_OF_PAST: u64 = 235;
/// Bytes that a virtual light takes at the peak, its share of the grid included.
///
/// A fifth more than its growth with vpls.count in `bench --build` over Sponza: 340 B from a
/// thousand to a million, 367 B to four millions.
const BYTES_PER_LIGHT: u64 = 440;

/// Refuses a render that is far beyond the free memory.
pub fn check_render(
    size: [usize; 2],
    settings: &Settings,
    is_sequence: bool,
) -> Result<(), Failure> {
    match find_available() {
        Some(available) => check_fit(size, settings, is_sequence, available),
        None => Ok(()),
    }
}

fn check_fit(
    [width, height]: [usize; 2],
    settings: &Settings,
    is_sequence: bool,
    available: u64,
) -> Result<(), Failure> {
    let lights = u64::from(settings.vpls.count) + u64::from(settings.vpls.emitter_count);
    let past = if is_sequence && settings.adds_up() { BYTES_OF_PAST } else { 0 };
    let needed = (width * height) as u64 * (BYTES_PER_PIXEL + past) + lights * BYTES_PER_LIGHT;
    if needed <= available {
        return Ok(());
    }
    let mib = |bytes: u64| bytes >> 20;
    Err(format!(
        "--size {width}x{height} with {lights} virtual lights needs about {} MiB of memory, but \
         {} MiB are free; choose a smaller --size or vpls.count",
        mib(needed),
        mib(available)
    )
    .into())
}

/// Memory that can be had without swapping, where the system tells.
fn find_available() -> Option<u64> {
    let kib = read_kib("/proc/meminfo", "MemAvailable:")?;
    Some(kib * 1024)
}

/// Largest resident size of this process so far, MiB, where the system tells.
pub fn find_peak_mib() -> Option<f64> {
    read_kib("/proc/self/status", "VmHWM:").map(|kib| kib as f64 / 1024.0)
}

/// Lets the largest resident size begin anew; whether the system can.
pub fn reset_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

fn read_kib(path: &str, label: &str) -> Option<u64> {
    let status = std::fs::read_to_string(path).ok()?;
    let line = status.lines().find(|l| l.starts_with(label))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_begins_anew() {
        // Other tests of this process allocate too, but nothing like this.
        let large = vec![1_u8; 512 << 20];
        let before = find_peak_mib().expect("Linux tells");
        drop(std::hint::black_box(large));
        if !reset_peak() {
            manylight_testing::skip("this system does not begin the peak of a process anew");
            return;
        }
        assert!(find_peak_mib().expect("Linux tells") < before - 256.0);
    }

    #[test]
    fn renders_beyond_the_free_memory_are_refused() {
        let settings = Settings::default();
        assert!(check_fit([1280, 720], &settings, true, 1 << 30).is_ok());
        let error = check_fit([16384, 16384], &settings, true, 1 << 30).expect_err("100 GB");
        assert!(error.to_string().contains("1024 MiB are free; choose a smaller"), "{error}");
        let mut sequence = Settings::default();
        assert!(check_fit([1400, 1400], &sequence, true, 1 << 30).is_ok());
        sequence.filter.temporal = true;
        assert!(check_fit([1400, 1400], &sequence, true, 1 << 30).is_err());
        assert!(check_fit([1400, 1400], &sequence, false, 1 << 30).is_ok());
        let mut many = Settings::default();
        many.vpls.count = 16_000_000;
        assert!(check_fit([8, 8], &many, true, 1 << 30).is_err());
    }
}
