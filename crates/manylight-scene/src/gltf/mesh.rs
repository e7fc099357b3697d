//! Meshes: one [`Mesh`] per triangle primitive.
//!
//! In: accessors · Out: indexed triangles with finite, non-degenerate geometry.
//! Limits: only vertices that triangles use are kept where a primitive uses few of many.

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};

use super::buffer::Accessor;
use super::skin::{self, Pose, Weights};
use super::{Budget, Document};
use crate::error::Warnings;
use crate::json::Item;
use crate::validate::{MAX_COORDINATE, OUT_OF_REACH};
use crate::{Error, Material, Mesh, Scene};

/// Name of the material that glTF gives to primitives without one.
const DEFAULT_MATERIAL: &str = "default material";
/// Longest name of a mesh or camera that is kept, characters.
const MAX_NAME_CHARS: usize = 200;

/// Loads all primitives of a mesh; returns their indices in the scene.
pub(crate) fn load_mesh(
    doc: &Document<'_>,
    reference: &Item<'_>,
    pose: Option<&Pose>,
    scene: &mut Scene,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<Vec<u32>, Error> {
    let (index, item) = doc.follow(reference, "meshes")?;
    let name = item.field("name")?.map_or(Ok(""), |n| n.text())?;
    let name = shorten(name);
    let primitives = item.required("primitives")?.items()?;
    let mut out = Vec::new();
    for (p, primitive) in primitives.iter().enumerate() {
        // Also where it is left out: nodes with skins come here again and again.
        budget.take::<Mesh>(1, primitive)?;
        let mut label = if name.is_empty() { format!("mesh {index}") } else { name.to_owned() };
        if primitives.len() > 1 {
            label = format!("{label} primitive {p}");
        }
        let loaded =
            load_primitive(doc, primitive, pose, budget, warnings).map_err(|e| match e {
                Error::Invalid { place, problem } => {
                    Error::invalid(&place, format!("{problem} (in mesh \"{label}\")"))
                }
                other => other,
            })?;
        let Some(mut mesh) = loaded else { continue };
        mesh.name = label;
        mesh.material = find_material(doc, primitive, scene)?;
        out.push(scene.meshes.len() as u32);
        scene.meshes.push(mesh);
    }
    Ok(out)
}

/// The start of a name that may be copied any number of times.
pub(crate) fn shorten(name: &str) -> &str {
    name.char_indices().nth(MAX_NAME_CHARS).map_or(name, |(end, _)| &name[..end])
}

/// The primitive's material, or glTF's default one, which is added when first needed.
fn find_material(
    doc: &Document<'_>,
    primitive: &Item<'_>,
    scene: &mut Scene,
) -> Result<u32, Error> {
    if let Some(reference) = primitive.field("material")? {
        return Ok(doc.follow(&reference, "materials")?.0 as u32);
    }
    let own_count = doc.list("materials")?.len();
    if scene.materials.len() == own_count {
        let name = DEFAULT_MATERIAL.to_owned();
        scene.materials.push(Material { name, ..Material::default() });
    }
    Ok(own_count as u32)
}

/// Attributes of one primitive.
struct Attributes<'a> {
    item: Item<'a>,
    positions: Accessor<'a>,
}

impl<'a> Attributes<'a> {
    /// An optional attribute with at least as many entries as there are positions.
    fn find(
        &self,
        doc: &'a Document<'_>,
        key: &str,
        types: &[&str],
        budget: &mut Budget,
    ) -> Result<Option<Accessor<'a>>, Error> {
        let Some(reference) = self.item.field(key)? else { return Ok(None) };
        let accessor = Accessor::new(doc, &reference, types, budget)?;
        if accessor.count < self.positions.count {
            return Err(reference.fail(format!(
                "{} entries for {} vertices; each vertex needs one",
                accessor.count, self.positions.count
            )));
        }
        Ok(Some(accessor))
    }
}

fn load_primitive<'a>(
    doc: &'a Document<'a>,
    primitive: &Item<'a>,
    pose: Option<&Pose>,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<Option<Mesh>, Error> {
    let mode_item = primitive.field("mode")?;
    let mode = mode_item.as_ref().map_or(Ok(4), |m| m.whole())?;
    if mode < 4 {
        warnings.add("a primitive of points or lines is left out", 1);
        return Ok(None);
    }
    if let (Some(item), true) = (mode_item, mode > 6) {
        return Err(item.fail(format!("unknown mode {mode}; allowed: 0 to 6")));
    }
    if primitive.field("targets")?.is_some() {
        warnings.add("the morph targets of a primitive are ignored", 1);
    }
    let item = primitive.required("attributes")?;
    let Some(reference) = item.field("POSITION")? else {
        warnings.add("a primitive without positions is left out", 1);
        return Ok(None);
    };
    let positions = Accessor::new(doc, &reference, &["VEC3"], budget)?;
    let attributes = Attributes { positions, item };
    let triangles = load_triangles(doc, primitive, &attributes, mode, budget)?;
    let (triangles, vertices) = keep_used(triangles, attributes.positions.count);
    let vertex_count = vertices.len() as u64;
    budget.take::<[Vec3; 2]>(vertex_count, primitive)?; // position and normal
    budget.take::<[Vec4; 3]>(vertex_count, primitive)?; // tangent, color, texture coordinates

    let weights = match pose {
        Some(_) => Weights::load(doc, &attributes.item, attributes.positions.count, budget)?,
        None => None,
    };
    let mut blends: Vec<DAffine3> = Vec::new();
    if let (Some(pose), Some(weights)) = (pose, &weights) {
        let blend = |v| weights.blend(pose, v, primitive);
        budget.take::<DAffine3>(vertex_count, primitive)?;
        blends = vertices.iter().map(blend).collect::<Result<_, _>>()?;
    }
    let read_position = |v| Vec3::from(attributes.positions.read::<3>(v));
    let mut mesh =
        Mesh { positions: vertices.iter().map(read_position).collect(), ..Mesh::default() };
    for (p, blend) in mesh.positions.iter_mut().zip(&blends) {
        *p = skin::move_point(blend, *p);
    }
    mesh.triangles = drop_unusable(&mesh.positions, triangles, warnings);
    if mesh.triangles.is_empty() {
        return Ok(None);
    }
    for p in mesh.positions.iter_mut().filter(|p| !is_usable(**p)) {
        *p = Vec3::ZERO; // no triangle uses it any more
    }
    load_shading(doc, &attributes, &vertices, &mut mesh, budget, warnings)?;
    for ((n, t), blend) in pad(&mut mesh).zip(&blends) {
        if let Some(n) = n {
            *n = skin::move_normal(blend, *n);
        }
        if let Some(t) = t {
            *t = skin::move_tangent(blend, *t);
        }
    }
    repair_normals(&mut mesh, warnings);
    Ok(Some(mesh))
}

/// Normal and tangent of each vertex, where the mesh has them.
fn pad(mesh: &mut Mesh) -> impl Iterator<Item = (Option<&mut Vec3>, Option<&mut Vec4>)> {
    let n = mesh.positions.len();
    let mut normals = mesh.normals.iter_mut();
    let mut tangents = mesh.tangents.iter_mut();
    (0..n).map(move |_| (normals.next(), tangents.next()))
}

/// Vertex numbers of all triangles, indices checked.
fn load_triangles(
    doc: &Document<'_>,
    primitive: &Item<'_>,
    attributes: &Attributes<'_>,
    mode: usize,
    budget: &mut Budget,
) -> Result<Vec<[u32; 3]>, Error> {
    let vertex_count = attributes.positions.count;
    let corners: Vec<u32> = match primitive.field("indices")? {
        Some(reference) => {
            let accessor = Accessor::new(doc, &reference, &["SCALAR"], budget)?;
            if !accessor.is_unsigned() {
                return Err(reference.fail("indices must be unsigned (5121, 5123 or 5125)"));
            }
            budget.take::<[u32; 4]>(accessor.count as u64, &reference)?;
            let corners: Vec<u32> = (0..accessor.count).map(|i| accessor.read_index(i)).collect();
            if let Some(bad) = corners.iter().find(|&&c| c as usize >= vertex_count) {
                return Err(reference.fail(format!(
                    "accessor {} names vertex {bad}, but there are {vertex_count} vertices; \
                     export the file again",
                    reference.value
                )));
            }
            corners
        }
        None => {
            budget.take::<[u32; 4]>(vertex_count as u64, primitive)?;
            (0..vertex_count as u32).collect()
        }
    };
    Ok(match mode {
        4 => corners.as_chunks::<3>().0.to_vec(),
        5 => {
            let strip = corners.windows(3).enumerate();
            strip
                .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
                .collect()
        }
        _ => {
            let rim = corners.get(1..).unwrap_or_default();
            rim.windows(2).map(|w| [w[0], w[1], corners[0]]).collect()
        }
    })
}

/// Vertices to read, and triangles that refer to them by place in that list.
fn keep_used(mut triangles: Vec<[u32; 3]>, count: usize) -> (Vec<[u32; 3]>, Vertices) {
    if count <= triangles.len().saturating_mul(12) {
        return (triangles, Vertices::All(count));
    }
    // Exporters let many primitives share one large vertex list: keep this one's part.
    let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    for corner in triangles.iter_mut().flatten() {
        *corner = used.binary_search(corner).unwrap_or(0) as u32;
    }
    (triangles, Vertices::Some(used))
}

/// Which vertices of the accessors a mesh reads.
enum Vertices {
    All(usize),
    Some(Vec<u32>),
}

impl Vertices {
    fn len(&self) -> usize {
        match self {
            Self::All(n) => *n,
            Self::Some(list) => list.len(),
        }
    }

    fn iter(&self) -> impl Iterator<Item = usize> {
        (0..self.len()).map(move |i| match self {
            Self::All(_) => i,
            Self::Some(list) => list[i] as usize,
        })
    }
}

fn is_usable(p: Vec3) -> bool {
    p.abs().max_element() <= MAX_COORDINATE && p.is_finite()
}

fn is_usable_uv(uv: Vec2) -> bool {
    uv.is_finite() && uv.abs().max_element() <= 1e9
}

/// Triangles with finite corners and an area; the others are counted.
fn drop_unusable(
    positions: &[Vec3],
    mut triangles: Vec<[u32; 3]>,
    warnings: &mut Warnings,
) -> Vec<[u32; 3]> {
    let (mut infinite_count, mut flat_count) = (0, 0);
    triangles.retain(|corners| {
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        if !(is_usable(a) && is_usable(b) && is_usable(c)) {
            infinite_count += 1;
            return false;
        }
        let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
        let has_area = (b - a).cross(c - a) != DVec3::ZERO;
        flat_count += u64::from(!has_area);
        has_area
    });
    warnings.add(&format!("a triangle with {OUT_OF_REACH} was dropped"), infinite_count);
    warnings.add("a triangle without area was dropped", flat_count);
    triangles
}

/// Normals, tangents, texture coordinates and colors.
fn load_shading(
    doc: &Document<'_>,
    attributes: &Attributes<'_>,
    vertices: &Vertices,
    mesh: &mut Mesh,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    if let Some(normals) = attributes.find(doc, "NORMAL", &["VEC3"], budget)? {
        mesh.normals = vertices.iter().map(|v| Vec3::from(normals.read::<3>(v))).collect();
    }
    if let Some(tangents) = attributes.find(doc, "TANGENT", &["VEC4"], budget)? {
        mesh.tangents = vertices.iter().map(|v| Vec4::from(tangents.read::<4>(v))).collect();
        let mut bad_count = 0;
        for t in &mut mesh.tangents {
            let sign = if t.w < 0.0 { -1.0 } else { 1.0 };
            *t = match t.truncate().try_normalize() {
                Some(direction) => direction.extend(sign),
                None => {
                    bad_count += 1;
                    Vec3::X.extend(sign)
                }
            };
        }
        warnings.add("a tangent that is not a direction was replaced", bad_count);
    }
    for set in 0..2 {
        let key = format!("TEXCOORD_{set}");
        if let Some(uvs) = attributes.find(doc, &key, &["VEC2"], budget)? {
            mesh.uvs[set] = vertices.iter().map(|v| Vec2::from(uvs.read::<2>(v))).collect();
            let mut bad_count = 0;
            for uv in mesh.uvs[set].iter_mut().filter(|uv| !is_usable_uv(**uv)) {
                *uv = Vec2::ZERO;
                bad_count += 1;
            }
            warnings.add("a texture coordinate not finite or beyond 1e9 became 0", bad_count);
        }
    }
    if let Some(colors) = attributes.find(doc, "COLOR_0", &["VEC3", "VEC4"], budget)? {
        let opaque = colors.width == 3;
        let read = |v| {
            let color = Vec4::from(colors.read::<4>(v));
            if opaque { color.truncate().extend(1.0) } else { color }
        };
        mesh.colors = vertices.iter().map(read).collect();
        let mut bad_count = 0;
        for color in &mut mesh.colors {
            let clamped = color.clamp(Vec4::ZERO, Vec4::ONE);
            if !color.is_finite() {
                *color = Vec4::ONE;
                bad_count += 1;
            } else if clamped != *color {
                *color = clamped;
                bad_count += 1;
            }
        }
        warnings.add("a vertex color outside 0…1 was clamped", bad_count);
    }
    Ok(())
}

/// Makes normals unit vectors; one that is no direction becomes the mean of its triangles'.
fn repair_normals(mesh: &mut Mesh, warnings: &mut Warnings) {
    let mut bad = Vec::new();
    for (i, n) in mesh.normals.iter_mut().enumerate() {
        match n.try_normalize() {
            Some(unit) => *n = unit,
            None => {
                *n = Vec3::ZERO;
                bad.push(i as u32);
            }
        }
    }
    if bad.is_empty() {
        return;
    }
    warnings.add("a normal that is not a direction was replaced", bad.len() as u64);
    let mut sums = vec![DVec3::ZERO; bad.len()];
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize].as_dvec3());
        for corner in corners {
            if let Ok(k) = bad.binary_search(corner) {
                sums[k] += (b - a).cross(c - a);
            }
        }
    }
    for (&v, sum) in bad.iter().zip(sums) {
        mesh.normals[v as usize] = sum.try_normalize().unwrap_or(DVec3::Y).as_vec3();
    }
}
