// One virtual light on an emissive triangle; twin of trace_emitters in trace.rs.

import package::emitter::surface;
import package::math::color;
import package::math::sequence;
import package::vlight::vpl::record;

struct EmitterParams {
    count: u32,
    seed: u32,
}

struct EmitterLight {
    light: Vpl,
    found: bool,
}

fn light_on_emitter(index: u32, params: EmitterParams) -> EmitterLight {
    var sequence = new_sequence(params.seed, index);
    let choice = next_2d(&sequence);
    let s = surface_sample(choice.x, next_2d(&sequence));
    let sides = select(1.0, 2.0, s.double_sided);
    let normal = select(s.normal, -s.normal, s.double_sided && choice.y < 0.5);
    let intensity = s.radiance * (sides / (s.pdf_area * f32(params.count)));
    let found = s.found && is_finite(intensity) && max_element(intensity) > 0.0;
    return EmitterLight(Vpl(s.position, normal, intensity), found);
}
