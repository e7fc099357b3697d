// A grid light by eight invocations in a row, one for each cell around its vertex: what they found,
// added up in the order of the cells.
import package::gather::grid::gpu::build::moments;

const_assert GROUP_X % 8u == 0u;

var<workgroup> partial: array<Moments, GROUP_X>;

// For the first of the eight; all invocations of the workgroup come by.
fn sum_octants(own: Moments, local: u32) -> Moments {
    workgroupBarrier();
    partial[local] = own;
    workgroupBarrier();
    // The first may write what the others have read of the light.
    storageBarrier();
    var sum = own;
    if local % 8u == 0u {
        for (var octant = 1u; octant < 8u; octant++) {
            sum = join(sum, partial[local + octant]);
        }
    }
    return sum;
}
