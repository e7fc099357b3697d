// What the receivers alone and sun, point and spot lights give to the layers of one sample.

import package::gpu::index;
import package::composite::brdf;

struct BeginParams {
    pixels: u32,
    // Of this sample among all of a pixel.
    weight: f32,
    // Whether the layers hold nothing worth keeping.
    is_first: u32,
    // Whether albedo and emission are summed up.
    is_sum: u32,
    // Shadow ratio where no gather will tell one.
    ratio: f32,
}

@group(0) @binding(0) var<uniform> params: BeginParams;
// Irradiance from sun, point and spot lights, with visibility.
@group(0) @binding(1) var<storage, read> irradiances: array<vec4f>;
@group(0) @binding(2) var<storage, read> albedos: array<vec4f>;
@group(0) @binding(3) var<storage, read> emissions: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> direct: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> indirect: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> unshadowed: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> mean_albedos: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> mean_emissions: array<vec4f>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.pixels {
        return;
    }
    let albedo = albedos[index].rgb;
    let light = brdf(albedo) * irradiances[index].rgb;
    var direct_sum = vec4f(light, 0.0) * params.weight;
    var indirect_sum = vec4f(0.0, 0.0, 0.0, params.ratio * params.weight);
    if params.is_first == 0u {
        direct_sum += direct[index];
        indirect_sum += indirect[index];
    } else {
        unshadowed[index] = vec4f(0.0);
    }
    direct[index] = direct_sum;
    indirect[index] = indirect_sum;
    if params.is_sum == 0u {
        return;
    }
    var albedo_sum = vec4f(albedo * params.weight, 0.0);
    var emission_sum = vec4f(emissions[index].rgb * params.weight, 0.0);
    if params.is_first == 0u {
        albedo_sum += mean_albedos[index];
        emission_sum += mean_emissions[index];
    }
    mean_albedos[index] = albedo_sum;
    mean_emissions[index] = emission_sum;
}
