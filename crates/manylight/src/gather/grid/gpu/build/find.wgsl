// Finding a cell by its place: open addressing over the list of all cells. Where a cell lies in the
// table depends on who came first, what is found there does not.
import package::math::sequence;
import package::gather::grid::gpu::record;

// Most slots that are tried: far more than a table that is at most half full ever needs.
const MOST_PROBES = 4096u;

fn first_slot(level: u32, cell_xy: u32, cell_z_lobe: u32, size: u32) -> u32 {
    let hash = hash_u32(hash_u32(cell_xy ^ (level << 12u)) ^ cell_z_lobe);
    return hash & (size - 1u);
}
