//! The node graph: what is placed where.
//!
//! In: JSON · Out: instances, lights, cameras and the sky of the shown scene, in world space.
//! Limits: a forest at most [`MAX_DEPTH`] deep; walked without recursion.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3, Vec4};

use super::buffer::Accessor;
use super::{Budget, Document, light, mesh, skin};
use crate::error::Warnings;
use crate::json::Item;
use crate::validate::{MAX_COORDINATE, OUT_OF_REACH};
use crate::{Error, Instance, Scene};

/// Deepest node hierarchy read.
const MAX_DEPTH: u32 = 1024;

/// Nodes with their places in the world.
#[derive(Debug)]
pub(crate) struct Graph<'a> {
    pub(crate) nodes: Vec<Item<'a>>,
    children: Vec<Vec<usize>>,
    has_parent: Vec<bool>,
    pub(crate) world_from_node: Vec<DAffine3>,
}

impl<'a> Graph<'a> {
    fn load(doc: &Document<'a>, warnings: &mut Warnings) -> Result<Self, Error> {
        let nodes = match doc.root().field("nodes")? {
            Some(list) => list.items()?,
            None => Vec::new(),
        };
        let mut children = Vec::with_capacity(nodes.len());
        let mut has_parent = vec![false; nodes.len()];
        for node in &nodes {
            let mut own = Vec::new();
            let list = node.field("children")?;
            for reference in list.map_or(Ok(Vec::new()), |l| l.items())? {
                let (child, _) = doc.follow(&reference, "nodes")?;
                if std::mem::replace(&mut has_parent[child], true) {
                    return Err(reference.fail(format!(
                        "node {child} is the child of more than one node; nodes must form trees: \
                         export the file again"
                    )));
                }
                own.push(child);
            }
            children.push(own);
        }
        let world_from_node = vec![DAffine3::IDENTITY; nodes.len()];
        let mut graph = Self { nodes, children, has_parent, world_from_node };
        graph.place(doc, warnings)?;
        Ok(graph)
    }

    /// Composes the transforms from the roots down; whatever no root reaches is a cycle.
    fn place(&mut self, doc: &Document<'_>, warnings: &mut Warnings) -> Result<(), Error> {
        let roots = (0..self.nodes.len()).filter(|&n| !self.has_parent[n]);
        let mut stack: Vec<(usize, u32, DAffine3)> =
            roots.map(|n| (n, 0, DAffine3::IDENTITY)).collect();
        let mut placed_count = 0;
        while let Some((n, depth, world_from_parent)) = stack.pop() {
            if depth > MAX_DEPTH {
                return Err(self.nodes[n].fail(format!(
                    "nodes are nested more than {MAX_DEPTH} deep; flatten the hierarchy"
                )));
            }
            placed_count += 1;
            let world_from_node = world_from_parent * parse_transform(&self.nodes[n], warnings)?;
            self.world_from_node[n] = world_from_node;
            stack.extend(self.children[n].iter().map(|&c| (c, depth + 1, world_from_node)));
        }
        if placed_count < self.nodes.len() {
            return Err(Error::invalid(
                &format!("{}: nodes", doc.file),
                "nodes contain each other in a cycle; nodes must form trees: export the file again",
            ));
        }
        Ok(())
    }

    /// Nodes of the shown scene, parents first, and the scene's own entry.
    fn shown(&self, doc: &Document<'a>) -> Result<(Vec<usize>, Option<Item<'a>>), Error> {
        let scene = match doc.root().field("scene")? {
            Some(reference) => Some(doc.follow(&reference, "scenes")?.1),
            None => doc.entry("scenes", 0)?,
        };
        let mut stack = Vec::new();
        match &scene {
            Some(scene) => {
                let list = scene.field("nodes")?;
                for reference in list.map_or(Ok(Vec::new()), |l| l.items())? {
                    stack.push(doc.follow(&reference, "nodes")?.0);
                }
            }
            None => stack.extend((0..self.nodes.len()).filter(|&n| !self.has_parent[n])),
        }
        stack.reverse();
        let mut order = Vec::new();
        let mut seen = vec![false; self.nodes.len()];
        while let Some(n) = stack.pop() {
            if std::mem::replace(&mut seen[n], true) {
                return Err(self.nodes[n].fail(
                    "the scene reaches this node more than once; nodes must form trees: export \
                     the file again",
                ));
            }
            order.push(n);
            stack.extend(self.children[n].iter().rev());
        }
        Ok((order, scene))
    }
}

/// Fills the scene with what the nodes of the shown scene carry.
pub(crate) fn load_nodes(
    doc: &Document<'_>,
    scene: &mut Scene,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let graph = Graph::load(doc, warnings)?;
    let (order, scene_item) = graph.shown(doc)?;
    if let Some(item) = &scene_item {
        scene.sky = light::load_sky(item)?;
    }
    // glTF mesh → its primitives in the scene; glTF skin → its pose.
    let mut known: HashMap<usize, Vec<u32>> = HashMap::new();
    let mut poses: HashMap<usize, skin::Pose> = HashMap::new();
    // How far each scene mesh reaches along its axes.
    let mut bounds: Vec<Vec3> = Vec::new();
    for n in order {
        let node = &graph.nodes[n];
        let world_from_node = graph.world_from_node[n];
        let name = node.field("name")?.map_or(Ok(""), |t| t.text())?;
        if let Some(reference) = node.field("camera")? {
            let camera = light::load_camera(doc, &reference, name, &world_from_node, warnings)?;
            scene.cameras.extend(camera);
        }
        if let Some(light) = find_extension(node, "KHR_lights_punctual")? {
            let reference = light.required("light")?;
            scene.lights.extend(light::load_light(doc, &reference, &world_from_node, warnings)?);
        }
        let Some(reference) = node.field("mesh")? else { continue };
        let (index, _) = doc.follow(&reference, "meshes")?;
        let (meshes, placements) = if let Some(skin) = node.field("skin")? {
            let pose = match poses.entry(doc.follow(&skin, "skins")?.0) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => entry.insert(skin::load_pose(doc, &skin, &graph, budget)?),
            };
            let meshes = mesh::load_mesh(doc, &reference, Some(pose), scene, budget, warnings)?;
            (meshes, vec![DAffine3::IDENTITY])
        } else {
            let meshes = match known.entry(index) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => {
                    entry.insert(mesh::load_mesh(doc, &reference, None, scene, budget, warnings)?)
                }
            };
            let placements = match find_extension(node, "EXT_mesh_gpu_instancing")? {
                Some(item) => load_instancing(doc, &item, &world_from_node, budget)?,
                None => vec![world_from_node],
            };
            (meshes.clone(), placements)
        };
        bounds.extend(scene.meshes[bounds.len()..].iter().map(|m| m.reach()));
        budget.take::<Instance>(meshes.len() as u64 * placements.len() as u64, node)?;
        place_meshes(scene, &meshes, &bounds, &placements, warnings);
    }
    Ok(())
}

fn find_extension<'a>(node: &Item<'a>, name: &str) -> Result<Option<Item<'a>>, Error> {
    node.field("extensions")?.map_or(Ok(None), |e| e.field(name))
}

/// Adds an instance of each mesh at each place, unless it would be out of reach.
fn place_meshes(
    scene: &mut Scene,
    meshes: &[u32],
    bounds: &[Vec3],
    placements: &[DAffine3],
    warnings: &mut Warnings,
) {
    let mut lost_count = 0;
    for world_from_node in placements {
        let matrix = world_from_node.matrix3.as_mat3();
        let world_from_object =
            Affine3A::from_mat3_translation(matrix, world_from_node.translation.as_vec3());
        let entries = world_from_object.to_cols_array();
        let is_usable = entries.iter().all(|x| x.abs() <= MAX_COORDINATE);
        for &mesh in meshes {
            if is_usable && is_in_reach(world_from_node, bounds[mesh as usize]) {
                scene.instances.push(Instance { mesh, world_from_object });
            } else {
                lost_count += 1;
            }
        }
    }
    warnings.add(&format!("a mesh placed at {OUT_OF_REACH} is left out"), lost_count);
}

/// Whether all that lies within a mesh's reach is kept where it is placed.
fn is_in_reach(world_from_node: &DAffine3, reach: Vec3) -> bool {
    let DAffine3 { matrix3: m, translation } = world_from_node;
    let reach = m.x_axis.abs() * f64::from(reach.x)
        + m.y_axis.abs() * f64::from(reach.y)
        + m.z_axis.abs() * f64::from(reach.z);
    (reach + translation.abs()).cmple(DVec3::splat(MAX_COORDINATE.into())).all()
}

/// TRS or matrix of a node; what is not usable is replaced by the identity with a warning.
fn parse_transform(node: &Item<'_>, warnings: &mut Warnings) -> Result<DAffine3, Error> {
    const REPAIRED: &str = "a node transform that is not a finite affine map was replaced";
    if let Some(item) = node.field("matrix")? {
        let m = DMat4::from_cols_array(&numbers::<16>(&item)?);
        let bottom = m.row(3);
        warnings.add(REPAIRED, u64::from(bottom.truncate() != DVec3::ZERO || bottom.w != 1.0));
        return Ok(DAffine3::from_mat4(m));
    }
    let vector = |key: &str, default: DVec3| -> Result<DVec3, Error> {
        node.field(key)?.map_or(Ok(default), |i| numbers::<3>(&i).map(DVec3::from))
    };
    let translation = vector("translation", DVec3::ZERO)?;
    let scale = vector("scale", DVec3::ONE)?;
    let mut rotation = DQuat::IDENTITY;
    if let Some(item) = node.field("rotation")? {
        let q = glam::DVec4::from(numbers::<4>(&item)?);
        match q.try_normalize() {
            Some(q) => rotation = DQuat::from_vec4(q),
            None => warnings.add(REPAIRED, 1),
        }
    }
    let matrix = DMat3::from_quat(rotation) * DMat3::from_diagonal(scale);
    Ok(DAffine3 { matrix3: matrix, translation })
}

fn numbers<const N: usize>(item: &Item<'_>) -> Result<[f64; N], Error> {
    Ok(item.singles::<N>()?.map(f64::from))
}

/// Placements of EXT_mesh_gpu_instancing: node · TRS for each entry.
fn load_instancing(
    doc: &Document<'_>,
    item: &Item<'_>,
    world_from_node: &DAffine3,
    budget: &mut Budget,
) -> Result<Vec<DAffine3>, Error> {
    let attributes = item.required("attributes")?;
    let mut accessor = |key: &str, kind: &str| -> Result<Option<Accessor<'_>>, Error> {
        let Some(reference) = attributes.field(key)? else { return Ok(None) };
        Accessor::new(doc, &reference, &[kind], budget).map(Some)
    };
    let translations = accessor("TRANSLATION", "VEC3")?;
    let rotations = accessor("ROTATION", "VEC4")?;
    let scales = accessor("SCALE", "VEC3")?;
    let given = [&translations, &rotations, &scales];
    let mut counts = given.iter().filter_map(|a| a.as_ref().map(|a| a.count));
    let Some(count) = counts.next() else {
        return Err(attributes.fail("has none of TRANSLATION, ROTATION, SCALE; add one"));
    };
    if counts.any(|other| other != count) {
        return Err(attributes.fail("its accessors have different counts; make them equal"));
    }
    budget.take::<DAffine3>(count as u64, &attributes)?;
    let place = |i: usize| {
        let t = translations.as_ref().map_or(Vec3::ZERO, |a| Vec3::from(a.read::<3>(i)));
        let s = scales.as_ref().map_or(Vec3::ONE, |a| Vec3::from(a.read::<3>(i)));
        let q = rotations.as_ref().map_or(Vec4::W, |a| Vec4::from(a.read::<4>(i)));
        let q = q.as_dvec4().try_normalize().map_or(DQuat::IDENTITY, DQuat::from_vec4);
        let matrix3 = DMat3::from_quat(q) * DMat3::from_diagonal(s.as_dvec3());
        *world_from_node * DAffine3 { matrix3, translation: t.as_dvec3() }
    };
    Ok((0..count).map(place).collect())
}
