"""The programs of surfaces in colour.

Light is computed in linear colour, tone-mapped, and stored as its square root (gamma 2).


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

COMMON = """
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
    + COMMON
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
