//! Skinned meshes in their rest pose.
//!
//! In: skin, node placements, joint attributes · Out: vertices in world space by linear blend
//! skinning. The placement of the mesh's own node is ignored, as glTF says.

use glam::{DAffine3, DMat4, DVec3, Vec3, Vec4};

use super::buffer::{Accessor, Component};
use super::node::Graph;
use super::{Budget, Document};
use crate::Error;
use crate::json::Item;

/// World from bind space for each joint.
#[derive(Debug)]
pub(crate) struct Pose(Vec<DAffine3>);

/// The pose of a skin with all nodes where the file puts them.
pub(crate) fn load_pose(
    doc: &Document<'_>,
    reference: &Item<'_>,
    graph: &Graph<'_>,
    budget: &mut Budget,
) -> Result<Pose, Error> {
    let (_, skin) = doc.follow(reference, "skins")?;
    let joints_item = skin.required("joints")?;
    let joints = joints_item.list()?;
    // The pose of each, and what it is made of.
    budget.take::<[DAffine3; 2]>(joints.len() as u64, &joints_item)?;
    let bind = match skin.field("inverseBindMatrices")? {
        Some(reference) => Some(Accessor::new(doc, &reference, &["MAT4"], budget)?),
        None => None,
    };
    if let Some(bind) = &bind
        && (bind.count < joints.len() || bind.component != Component::F32)
    {
        return Err(skin.fail(format!(
            "inverseBindMatrices must hold one float matrix for each of the {} joints",
            joints.len()
        )));
    }
    let mut pose = Vec::with_capacity(joints.len());
    for (i, joint) in joints.iter().enumerate() {
        let node = match joint.as_u64().and_then(|n| usize::try_from(n).ok()) {
            Some(node) if node < graph.nodes.len() => node,
            _ => doc.follow(&joints_item.items()?[i], "nodes")?.0, // tells what is wrong
        };
        let joint_from_bind = bind.as_ref().map_or(DAffine3::IDENTITY, |bind| {
            DAffine3::from_mat4(DMat4::from_cols_array(&bind.read::<16>(i).map(f64::from)))
        });
        pose.push(graph.world_from_node[node] * joint_from_bind);
    }
    Ok(Pose(pose))
}

/// Joint numbers and weights of a primitive's vertices.
#[derive(Debug)]
pub(crate) struct Weights<'a> {
    sets: Vec<(Accessor<'a>, Accessor<'a>)>,
}

impl<'a> Weights<'a> {
    /// `JOINTS_0`/`WEIGHTS_0` and further sets; `None` where the mesh has none.
    pub(crate) fn load(
        doc: &'a Document<'_>,
        attributes: &Item<'_>,
        vertex_count: usize,
        budget: &mut Budget,
    ) -> Result<Option<Self>, Error> {
        let mut sets = Vec::new();
        for set in 0..4 {
            let joints = attributes.field(&format!("JOINTS_{set}"))?;
            let weights = attributes.field(&format!("WEIGHTS_{set}"))?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            let j = Accessor::new(doc, &joints, &["VEC4"], budget)?;
            let w = Accessor::new(doc, &weights, &["VEC4"], budget)?;
            if j.count < vertex_count || w.count < vertex_count {
                return Err(joints.fail(format!(
                    "joints or weights for fewer than the {vertex_count} vertices; export again"
                )));
            }
            sets.push((j, w));
        }
        Ok((!sets.is_empty()).then_some(Self { sets }))
    }

    /// World from bind space of one vertex; weights are made to sum to 1.
    pub(crate) fn blend(
        &self,
        pose: &Pose,
        vertex: usize,
        place: &Item<'_>,
    ) -> Result<DAffine3, Error> {
        let mut matrix = glam::DMat3::ZERO;
        let mut translation = DVec3::ZERO;
        let mut sum = 0.0;
        for (joints, weights) in &self.sets {
            let joints = joints.read::<4>(vertex);
            for (joint, weight) in joints.into_iter().zip(weights.read::<4>(vertex)) {
                if !(weight > 0.0 && weight.is_finite()) {
                    continue;
                }
                let Some(placed) = pose.0.get(joint as usize) else {
                    return Err(place.fail(format!(
                        "vertex {vertex} follows joint {joint}, but the skin has {} joints",
                        pose.0.len()
                    )));
                };
                let weight = f64::from(weight);
                matrix += placed.matrix3 * weight;
                translation += placed.translation * weight;
                sum += weight;
            }
        }
        if sum <= 0.0 {
            return Ok(pose.0.first().copied().unwrap_or(DAffine3::IDENTITY));
        }
        Ok(DAffine3 { matrix3: matrix * (1.0 / sum), translation: translation / sum })
    }
}

/// A skinned position.
pub(crate) fn move_point(world_from_bind: &DAffine3, p: Vec3) -> Vec3 {
    world_from_bind.transform_point3(p.as_dvec3()).as_vec3()
}

/// A skinned normal, by the cofactor matrix: right for any scale, no inverse needed.
pub(crate) fn move_normal(world_from_bind: &DAffine3, n: Vec3) -> Vec3 {
    let m = &world_from_bind.matrix3;
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let n = n.as_dvec3();
    let moved = y.cross(z) * n.x + z.cross(x) * n.y + x.cross(y) * n.z;
    moved.try_normalize().unwrap_or(DVec3::ZERO).as_vec3()
}

/// A skinned tangent.
pub(crate) fn move_tangent(world_from_bind: &DAffine3, t: Vec4) -> Vec4 {
    let moved = world_from_bind.transform_vector3(t.truncate().as_dvec3());
    moved.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().extend(t.w)
}
