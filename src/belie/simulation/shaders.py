"""The renderer's programs. Light is computed in linear colour, tone-mapped, and stored as its square root (gamma 2).

What a weather or a material lacks is left out by ``#define``: a foggy day does not pay for headlights, nor a wall for
the gloss of a car. llvmpipe never skips a branch, so that what is not compiled in is all that saves time. Opaque and
cut-out surfaces have programs of their own: ``discard`` defeats early depth tests.
"""

from __future__ import annotations

VERTEX = """
#version 330
uniform mat4 model;
uniform mat4 view_projection;
uniform mat4 sun_projection;
in vec3 in_point;
in vec3 in_normal;
in vec2 in_uv;
in vec4 in_colour;
out vec3 v_world;
out vec3 v_normal;
out vec2 v_uv;
out vec4 v_colour;
out vec3 v_sun;
void main() {
    vec4 world = model * vec4(in_point, 1.0);
    v_world = world.xyz;
    v_normal = mat3(model) * in_normal;
    v_uv = in_uv;
    v_colour = in_colour;
    v_sun = (sun_projection * world).xyz * 0.5 + 0.5;
    gl_Position = view_projection * world;
}
"""

_COMMON = """
uniform vec3 eye;
uniform vec3 sun_direction;
uniform vec3 sun_light;
uniform vec3 sky_light;
uniform vec3 bounce_light;
uniform vec3 fog_light;
uniform float extinction;
uniform float exposure;

vec3 tone(vec3 light) {  // Narkowicz' fit of the ACES curve, then gamma 2
    vec3 x = light * exposure;
    return sqrt(clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0));
}

vec3 sky_colour(vec3 direction) {
    float up = clamp(direction.z, 0.0, 1.0);
    return mix(fog_light, sky_light * vec3(0.55, 0.85, 1.25), 1.0 - exp(-4.0 * up));
}
"""

FRAGMENT = (
    "#version 330\n/*DEFINES*/\n"
    + _COMMON
    + """
uniform sampler2D image;
uniform sampler2D detail;
uniform sampler2DShadow still_shadow;
uniform sampler2DShadow moving_shadow;
uniform sampler2D lamp_map;
uniform sampler2D mirror;
uniform vec4 lamp_area;      // x0, y0, 1 / width, 1 / height
uniform vec3 lamp_light;
uniform vec3 headlight;
uniform vec3 headlight_direction;
uniform float headlight_power;
uniform vec2 size;           // of the picture, for what the wet road mirrors
uniform float gloss;
uniform float glow;
uniform float wetness;
in vec3 v_world;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_colour;
in vec3 v_sun;
out vec4 out_colour;

void main() {
    vec4 texel = texture(image, v_uv);
#ifdef CUTOUT
    // Alpha is sharpened about its threshold, so that leaves stay dense in small mip levels.
    float alpha = clamp((texel.a - 0.4) / max(fwidth(texel.a), 0.05) + 0.5, 0.0, 1.0);
    if (alpha < 0.05) discard;
#endif
#ifdef MIRRORED
    if (v_world.z < 0.02) discard;
#endif
    vec3 offset = eye - v_world;
    float range = length(offset);
    vec3 towards = offset / range;
    vec3 normal = normalize(v_normal);
#ifdef TWO_SIDED
    if (dot(normal, sun_direction) < 0.0) normal = normalize(normal + 0.9 * sun_direction);
#endif
    vec3 albedo = texel.rgb * texel.rgb * v_colour.rgb * v_colour.rgb;
#if defined(STAINED) || (defined(WET) && defined(GROUND))
    vec4 broad = texture(detail, (v_world.xy + v_world.z * vec2(0.8, 0.6)) * 0.023);
#endif
#ifdef STAINED
    // Broad stains, fixed to the world, break the repetition of textures.
#ifdef GROUND
    albedo *= 1.0 + 0.26 * (broad.g - 0.5) + 0.2 * (broad.r - 0.5);  // traffic wears a road evenly
#else
    albedo *= 1.0 + 0.45 * (broad.g - 0.5) + 0.2 * (broad.r - 0.5);
#endif
#endif
    float open = v_colour.a;
    vec3 light = mix(bounce_light, sky_light, 0.5 + 0.5 * normal.z) * open * open;
#ifdef SUN
    // Two taps, each filtered over 2 x 2 texels: about the penumbra of a roof.
    vec3 at = vec3(v_sun.xy, v_sun.z - 0.0009);
    float lit = 0.5 * (texture(still_shadow, at + vec3(0.0004, 0.0002, 0.0))
                     + texture(still_shadow, at - vec3(0.0004, 0.0002, 0.0)));
    lit *= texture(moving_shadow, at);
    float inside = max(abs(v_sun.x - 0.5), abs(v_sun.y - 0.5));
    lit = mix(lit, 0.75, smoothstep(0.42, 0.5, inside));
    float falling = max(dot(normal, sun_direction), 0.0);
#ifdef TWO_SIDED
    falling *= open;
#endif
    light += sun_light * falling * lit;
#endif
#ifdef LAMPS
    float lamp = texture(lamp_map, (v_world.xy - lamp_area.xy) * lamp_area.zw).r;
    light += lamp_light * lamp * (0.45 + 0.55 * max(normal.z, 0.0)) * LAMP_FALLOFF * (0.4 + 0.6 * open);
#endif
#ifdef HEADLIGHTS
    vec3 ray = v_world - headlight;
    float reach = length(ray);
    ray /= reach;
    float cone = smoothstep(0.72, 0.98, dot(ray, headlight_direction));
    float cut = 0.10 + 0.90 * smoothstep(0.05, -0.015, ray.z);  // dipped beam
    light += vec3(1.0, 0.95, 0.84) * headlight_power * cone * cut * (0.22 + 0.78 * max(dot(normal, -ray), 0.0))
             / (1.0 + 0.012 * reach * reach);
#endif
    vec3 colour = albedo * light;
    float facing = clamp(dot(normal, towards), 0.0, 1.0);
    vec3 bounced = reflect(-towards, normal);
    float fresnel = pow(1.0 - facing, 4.0);
#if defined(WET) && defined(GROUND)
    // Puddles stand where broad noise is low; the rest is a dark film.
    vec4 noise = texture(detail, v_world.xy * 0.43);
    float puddle = smoothstep(0.40, 0.24, broad.b) * step(0.7, normal.z);
    float film = wetness * max(normal.z, 0.0) * WET_GROUND;
    colour *= 1.0 - 0.45 * film;
#ifdef MIRROR
    vec2 ripple = (noise.rg - 0.5) * (0.06 - 0.05 * puddle) * vec2(0.35, 1.0) * min(1.0, 12.0 / range);
    // Rough asphalt smears what it mirrors upright; a puddle shows it sharp.
    vec2 at_mirror = gl_FragCoord.xy / size + ripple;
    float blur = 3.4 - 2.8 * puddle;
    vec2 upright = vec2(0.0, 0.022 * (1.0 - puddle));
    vec3 seen = 0.5 * (texture(mirror, at_mirror + upright, blur).rgb + texture(mirror, at_mirror - upright, blur).rgb);
    float share = film * (0.03 + 0.60 * fresnel) * (0.50 + 0.70 * puddle);
    colour = mix(colour, seen * seen * 0.85, clamp(share, 0.0, 0.8));
#endif
#endif
#ifdef GLOSS
    colour += gloss * sky_colour(bounced) * (0.10 + 0.90 * fresnel) * open;
#ifdef SUN
    colour += gloss * sun_light * lit * pow(max(dot(bounced, sun_direction), 0.0), 90.0) * 4.0;
#endif
#endif
#ifdef DECAL
    float glowing = 0.0;
#elif defined(CUTOUT)
    float glowing = 0.0;
#else
    float glowing = texel.a;
#endif
    colour += texel.rgb * texel.rgb * glowing * max(glow, NIGHT_GLOW * (0.4 + 0.6 * v_colour.r));
#ifdef HAZE
    colour = mix(fog_light, colour, exp(-extinction * range));
#endif
    out_colour = vec4(tone(colour), 1.0);
#ifdef CUTOUT
    out_colour.a = alpha;
#endif
#ifdef DECAL
    out_colour.a = texel.a * v_colour.a;
#endif
}
"""
)

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
    + _COMMON
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
