"""The programs of all that is no surface in colour: sky, lamps seen as such, shadows and the truth."""

from __future__ import annotations

from belie.simulation.surface_shaders import COMMON

FULL_SCREEN = """
#version 330
uniform mat3 rays;  // picture to world, or to the camera
out vec3 v_ray;
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    v_ray = rays * vec3(corner, 1.0);
    gl_Position = vec4(corner, 1.0, 1.0);
}
"""

SKY = (
    "#version 330\n"
    + COMMON
    + """
uniform sampler2D clouds;
uniform float cloud_share;
in vec3 v_ray;
out vec4 out_colour;
void main() {
    vec3 ray = normalize(v_ray);
    vec3 colour = sky_colour(ray);
    float up = max(ray.z, 0.0);
    vec2 place = ray.xy / (up + 0.16);
    float thick = texture(clouds, place * 0.055).r * 0.7 + texture(clouds, place * 0.21 + 0.37).g * 0.3;
    float cover = smoothstep(0.66 - 0.5 * cloud_share, 0.92 - 0.3 * cloud_share, thick) * smoothstep(0.0, 0.12, up);
    vec3 white = sky_light * 1.35 + sun_light * 0.42 * (0.6 + 0.4 * thick);
    colour = mix(colour, white * (1.15 - 0.45 * thick * cloud_share), cover * 0.85);
    float near_sun = max(dot(ray, sun_direction), 0.0);
    float disc = 30.0 * smoothstep(0.99985, 0.99995, near_sun);
    colour += sun_light * (0.10 * pow(near_sun, 12.0) + 0.35 * pow(near_sun, 120.0) + disc);
    colour = mix(colour, fog_light, 1.0 - exp(-extinction * 700.0 * (1.0 - 0.6 * up)));
    out_colour = vec4(tone(colour), 1.0);
}
"""
)

SHADOW_VERTEX = """
#version 330
uniform mat4 model;
uniform mat4 sun_projection;
in vec3 in_point;
in vec2 in_uv;
out vec2 v_uv;
void main() {
    v_uv = in_uv;
    gl_Position = sun_projection * (model * vec4(in_point, 1.0));
}
"""

SHADOW_FRAGMENT = """
#version 330
/*DEFINES*/
uniform sampler2D image;
in vec2 v_uv;
void main() {
#ifdef CUTOUT
    if (texture(image, v_uv).a < 0.5) discard;
#endif
}
"""

TRUTH_VERTEX = """
#version 330
uniform mat4 model;
uniform mat4 model_rate;   // time derivative of `model`
uniform mat4 view;
uniform mat4 view_rate;
uniform mat4 projection;
in vec3 in_point;
in vec2 in_uv;
in float in_id;
flat out float v_id;
out vec2 v_uv;
out vec3 v_camera;
out vec3 v_rate;
void main() {
    vec4 point = vec4(in_point, 1.0);
    vec4 world = model * point;
    v_uv = in_uv;
    v_id = in_id;
    v_camera = (view * world).xyz;
    v_rate = (view_rate * world).xyz + mat3(view) * (model_rate * point).xyz;
    gl_Position = projection * vec4(v_camera, 1.0);
}
"""

TRUTH_FRAGMENT = """
#version 330
/*DEFINES*/
uniform sampler2D image;
uniform vec2 focal;
uniform float id;
in vec2 v_uv;
in vec3 v_camera;
in vec3 v_rate;
flat in float v_id;
out vec4 out_truth;  // depth, id, motion in pixels a second
void main() {
#ifdef CUTOUT
    if (texture(image, v_uv).a < 0.4) discard;
#endif
    vec2 flow = focal * (v_rate.xy - v_camera.xy / v_camera.z * v_rate.z) / v_camera.z;
    out_truth = vec4(v_camera.z, id + v_id, flow);
}
"""

FAR_TRUTH = """
#version 330
uniform vec2 focal;
uniform vec3 turn;  // angular velocity of the camera, in its own axes
in vec3 v_ray;
out vec4 out_truth;
void main() {
    vec3 ray = v_ray / v_ray.z;
    vec3 rate = -cross(turn, ray);
    out_truth = vec4(1.0e9, 0.0, focal * (rate.xy - ray.xy * rate.z));
}
"""

GLOW_VERTEX = """
#version 330
uniform mat4 view;
uniform mat4 projection;
in vec3 in_centre;
in vec3 in_light;
in float in_radius;
out vec2 v_corner;
out vec3 v_light;
void main() {
    v_corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    v_light = in_light;
    vec4 camera = view * vec4(in_centre, 1.0);
    camera.xy += v_corner * in_radius;
    camera.z -= 0.25;  // before the lamp's own glass
    gl_Position = projection * camera;
}
"""

GLOW_FRAGMENT = """
#version 330
in vec2 v_corner;
in vec3 v_light;
out vec4 out_colour;
void main() {
    float r = length(v_corner);
    float fade = clamp(1.0 - r, 0.0, 1.0);
    float core = exp(-60.0 * r * r);
    out_colour = vec4(v_light * (0.30 * fade * fade * fade + 0.9 * core) + vec3(0.5 * core * v_light.g), 1.0);
}
"""


def with_defines(source: str, defines: dict[str, str]) -> str:
    r"""A program's source with some names defined.

    >>> with_defines("#version 330\n/*DEFINES*/", {"SUN": "1"})
    '#version 330\n#define SUN 1'
    """
    lines = "\n".join(f"#define {name} {value}".rstrip() for name, value in defines.items())
    return source.replace("/*DEFINES*/", lines)
