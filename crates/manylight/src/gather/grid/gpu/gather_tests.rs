use super::*;

#[test]
fn kernels_of_gathering_are_as_declared() {
    use crate::gpu::testing::check_kernel;
    alpha::KERNELS.iter().chain(gather::KERNELS).for_each(|kernel| check_kernel(kernel));
}
