//! The threads of the whole program.

use crate::Failure;

/// Most threads.
const MAX_THREADS: usize = 1024;
/// Says how many where the command line does not.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// Starts them all; done before anything needs one, so that a failure is no surprise later.
pub fn start(wanted: Option<usize>) -> Result<(), Failure> {
    let count = choose_count(wanted, std::env::var(VARIABLE).ok().as_deref())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
    pool.map_err(|e| {
        format!(
            "cannot start {count} threads: {e}; use fewer (--threads or {VARIABLE}), a smaller \
             RUST_MIN_STACK or a higher limit of the system"
        )
        .into()
    })
}

/// As many as the command line says, else the environment, else one for each core.
fn choose_count(wanted: Option<usize>, variable: Option<&str>) -> Result<usize, Failure> {
    let variable = variable.and_then(|text| text.trim().parse().ok()).filter(|&n: &usize| n > 0);
    let (name, count) = match (wanted, variable) {
        (Some(count), _) => ("--threads ", count),
        (None, Some(count)) => ("RAYON_NUM_THREADS=", count),
        (None, None) => {
            let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
            return Ok(cores.min(MAX_THREADS));
        }
    };
    if !(1..=MAX_THREADS).contains(&count) {
        return Err(format!("{name}{count}: use 1 to {MAX_THREADS}").into());
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_threads_is_bounded_wherever_it_comes_from() {
        let problem = |wanted, variable| choose_count(wanted, variable).unwrap_err().to_string();
        assert_eq!(problem(Some(0), None), "--threads 0: use 1 to 1024");
        assert_eq!(problem(None, Some("65536")), "RAYON_NUM_THREADS=65536: use 1 to 1024");
        assert_eq!(choose_count(Some(3), Some("65536")).ok(), Some(3));
        assert_eq!(choose_count(None, Some(" 5 ")).ok(), Some(5));
        for odd in ["0", "", "many", "99999999999999999999"] {
            assert_eq!(choose_count(None, Some(odd)).ok(), choose_count(None, None).ok());
        }
    }
}
