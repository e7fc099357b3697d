// Drawing one virtual light out of a grid light; twin of draw.rs.
//
// Reads `cells`, `octants`, `points`, `blocks`, `vpls`, `info`. Where the twin takes differences of
// running sums, inside a crowded cell, this walks over blocks of blocks and blocks: single
// precision has no digits for such differences.

// The hat function of one vertex.
struct Hat {
    scale: f32,
    vertex: vec3f,
}

// A weight inside a cell: per axis its values at the lower and the upper end.
struct Weight {
    x: vec2f,
    y: vec2f,
    z: vec2f,
}

// Some of a list, and what is left of a target there.
struct Chosen {
    index: u32,
    left: f32,
}

fn share_of_point(hat: Hat, point: vec4f) -> f32 {
    let along = max(1.0 - abs(point.xyz * hat.scale - hat.vertex), vec3f(0.0));
    return point.w * along.x * along.y * along.z;
}

// Weight of a corner's hat function.
fn weight_of_corner(corner: u32) -> Weight {
    let ends = array<vec2f, 2>(vec2f(1.0, 0.0), vec2f(0.0, 1.0));
    var both = ends;
    return Weight(both[corner & 1u], both[(corner >> 1u) & 1u], both[corner >> 2u]);
}

fn halve(line: vec2f, is_upper: bool) -> vec2f {
    let middle = 0.5 * (line.x + line.y);
    return select(vec2f(line.x, middle), vec2f(middle, line.y), is_upper);
}

// The same weight inside one eighth of the cell.
fn inside(weight: Weight, octant: u32) -> Weight {
    return Weight(
        halve(weight.x, (octant & 1u) != 0u),
        halve(weight.y, (octant & 2u) != 0u),
        halve(weight.z, (octant & 4u) != 0u),
    );
}

// Values at the four corners at the lower end of z (side 0) or the upper.
fn corners(weight: Weight, z: f32) -> vec4f {
    return weight.x.xyxy * weight.y.xxyy * z;
}

// Mass of things that share something to the corners of a cell, under a weight.
fn mass(weight: Weight, share: array<f32, 8>) -> f32 {
    let low = vec4f(share[0], share[1], share[2], share[3]);
    let high = vec4f(share[4], share[5], share[6], share[7]);
    let sum = corners(weight, weight.z.x) * low + corners(weight, weight.z.y) * high;
    return (sum.x + sum.y) + (sum.z + sum.w);
}

// Draws a virtual light of a grid light; returns its position among the virtual lights.
fn draw(light: u32, level: u32, u: f32) -> u32 {
    // The cell around the vertex, by its known mass.
    var total = 0.0;
    for (var i = 0u; i < 8u; i++) {
        total += octants[light].luminance[i];
    }
    var octant = 0u;
    var left = u * total;
    var rest = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let share = octants[light].luminance[i];
        if share > 0.0 {
            octant = i;
            rest = min(left, share);
            if left < share {
                break;
            }
            left -= share;
        }
    }
    var cell = octants[light].cells[octant];
    // The vertex is the corner on the other side of the first cell.
    let corner = 7u - octant;
    var weight = weight_of_corner(corner);
    for (var finer = level - 1u; finer > 0u; finer--) {
        if cells[cell + 1u].light - cells[cell].light <= BLOCK {
            break;
        }
        let chosen = choose_cell(cell, weight, rest);
        cell = chosen.index;
        rest = chosen.left;
        weight = inside(weight, cells[cell].octant_owned & 7u);
    }
    let first = cells[cell].light;
    let last = min(max(cells[cell + 1u].light, first), info.vpl_count);
    // Any light inside tells where that first cell is.
    let scale = 1.0 / f32(1u << (level - 1u));
    let upper = vec3f(vec3u(corner, corner >> 1u, corner >> 2u) & vec3u(1u));
    let hat = Hat(scale, floor(points[first].xyz * scale) + upper);
    return draw_in(first, last, hat, weight, rest);
}

// The finer cell inside a cell where the running mass passes `target_mass`.
fn choose_cell(cell: u32, weight: Weight, target_mass: f32) -> Chosen {
    let first = cells[cell].inner;
    let last = min(cells[cell + 1u].inner, first + 8u);
    var chosen = Chosen(first, 0.0);
    var left = target_mass;
    for (var finer = first; finer < last; finer++) {
        let m = mass(weight, cells[finer].share);
        if m > 0.0 {
            chosen = Chosen(finer, min(left, m));
            if left < m {
                break;
            }
            left -= m;
        }
    }
    return chosen;
}

// The light of a range where the running mass passes `target_mass`, or the last one with a mass.
fn scan(first: u32, last: u32, hat: Hat, target_mass: f32) -> u32 {
    var chosen = first;
    var left = target_mass;
    for (var i = first; i < min(last, first + MOST_SCANNED); i++) {
        let share = share_of_point(hat, points[i]);
        if share > 0.0 {
            chosen = i;
            if left < share {
                break;
            }
            left -= share;
        }
    }
    return chosen;
}

fn sum_of_points(first: u32, last: u32, hat: Hat) -> f32 {
    var sum = 0.0;
    for (var i = first; i < min(last, first + BLOCK); i++) {
        sum += share_of_point(hat, points[i]);
    }
    return sum;
}

// Draws a light of a cell: the one where the running mass passes `target_mass`.
fn draw_in(first: u32, last: u32, hat: Hat, weight: Weight, target_mass: f32) -> u32 {
    if last - first <= MOST_SCANNED {
        return scan(first, last, hat, target_mass);
    }
    // Whole blocks by their sums, the lights before and after them one by one.
    let first_block = (first + BLOCK - 1u) / BLOCK;
    let last_block = last / BLOCK;
    let head = sum_of_points(first, first_block * BLOCK, hat);
    if target_mass < head {
        return scan(first, first_block * BLOCK, hat, target_mass);
    }
    let chosen = choose_block(first_block, last_block, weight, target_mass - head);
    let tail = sum_of_points(last_block * BLOCK, last, hat);
    if chosen.index == last_block && tail > 0.0 {
        return scan(last_block * BLOCK, last, hat, chosen.left);
    }
    let block = min(chosen.index, last_block - 1u);
    return scan(block * BLOCK, (block + 1u) * BLOCK, hat, chosen.left);
}

// The block where the running mass passes `target_mass`; `last` if none does.
fn choose_block(first: u32, last: u32, weight: Weight, target_mass: f32) -> Chosen {
    let superblocks = (arrayLength(&vpls) + BLOCK - 1u) / BLOCK;
    let per = SUPERBLOCK / BLOCK;
    var left = target_mass;
    var block = first;
    while block < last {
        let is_whole = block % per == 0u && block + per <= last;
        let place = select(block, superblocks + block / per, is_whole);
        let m = mass(weight, blocks[place]);
        if left < m && !is_whole {
            return Chosen(block, left);
        }
        if left < m {
            break;
        }
        left -= m;
        block += select(1u, per, is_whole);
    }
    let end = min(block + per, last);
    for (; block < end; block++) {
        let m = mass(weight, blocks[block]);
        if left < m {
            return Chosen(block, left);
        }
        left -= m;
    }
    return Chosen(block, left);
}
