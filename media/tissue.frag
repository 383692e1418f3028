#version 120
// Tissue: two colours mixed by the pattern of include/meshless_surgery/appearance/look.h, or an image, uneven to light,
// under a film of water. Two lamps: one at the camera, as an endoscope has it, and one above. A program for each pattern:
// software GL takes every branch. NOISE is as in Look.msg, 7 for what is plain and even, 8 for an image by texture
// coordinates, which `place` then has.

uniform vec4 second;
uniform float scale;   // [m] of a cell of the pattern, of the image's width
uniform float wetness;
uniform float bump;
#if NOISE == 6 || NOISE == 8
uniform sampler2D image;
#endif
#if NOISE == 6
uniform float aspect;  // width over height
#endif
uniform vec4 tips[4];  // of instruments, in the world, and how wide they are [m]; 0: none

varying vec3 seen_at;
varying vec3 normal;
varying vec3 above;
varying vec3 at;
varying vec3 place;
varying vec3 turned;
varying float growth;
varying float pressed;
varying float from_rim;

const float PERIOD = 289.0;
const float JITTER = 0.3;
const float RIM = 0.003;  // [m] how far from a cut's edge tissue is bloody

// --- the same functions as in src/appearance/look.cpp

vec4 remainderOf(vec4 x) { return x - floor(x / PERIOD) * PERIOD; }
vec4 permuted(vec4 x) { return remainderOf((34.0 * x + 1.0) * x); }
// Of the four cells that begin at one and go on along x and y, and of those beyond them along z.
void hashesOf(vec3 cell, out vec4 near, out vec4 beyond)
{
  vec4 x = remainderOf(cell.xxxx + vec4(0.0, 1.0, 0.0, 1.0)), y = remainderOf(cell.yyyy + vec4(0.0, 0.0, 1.0, 1.0));
  vec4 z = remainderOf(cell.zzzz + vec4(0.0, 1.0, 0.0, 0.0)), columns = permuted(permuted(x) + y);
  near = permuted(columns + z.x);
  beyond = permuted(columns + z.y);
}
vec3 vectorOf(float hash) { return 2.0 * fract(vec3(0.618034, 0.754878, 0.569840) * hash) - 1.0; }

float along(float hash, vec3 from) { return dot(vectorOf(hash), from); }
float gradientNoise(vec3 p)
{
  vec3 cell = floor(p), i = p - cell, j = i - 1.0;
  vec3 f = i * i * i * (i * (6.0 * i - 15.0) + 10.0);
  vec4 near, beyond;
  hashesOf(cell, near, beyond);
  vec4 low = vec4(along(near.x, i), along(near.y, vec3(j.x, i.yz)), along(near.z, vec3(i.x, j.y, i.z)),
                  along(near.w, vec3(j.xy, i.z)));
  vec4 high = vec4(along(beyond.x, vec3(i.xy, j.z)), along(beyond.y, vec3(j.x, i.y, j.z)),
                   along(beyond.z, vec3(i.x, j.yz)), along(beyond.w, j));
  vec4 plane = mix(low, high, f.z);
  vec2 line = mix(plane.xy, plane.zw, f.y);
  return mix(line.x, line.y, f.x);
}

// x, y: how far the nearest and the next seed are, squared; z: the nearest one's hash.
void meet(float hash, vec3 from, inout vec3 seeds)
{
  vec3 to = from + JITTER * vectorOf(hash);
  float far = dot(to, to);
  seeds.z = far < seeds.x ? hash : seeds.z;
  seeds.y = min(seeds.y, max(seeds.x, far));
  seeds.x = min(seeds.x, far);
}
// How far beyond the wall of its cell, and the cell's tint.
vec2 cellsAt(vec3 p)
{
  vec3 first = floor(p - 0.5), i = first + 0.5 - p, j = i + 1.0;
  vec4 near, beyond;
  hashesOf(first, near, beyond);
  vec3 seeds = vec3(1e9, 1e9, 0.0);
  meet(near.x, i, seeds);
  meet(near.y, vec3(j.x, i.yz), seeds);
  meet(near.z, vec3(i.x, j.y, i.z), seeds);
  meet(near.w, vec3(j.xy, i.z), seeds);
  meet(beyond.x, vec3(i.xy, j.z), seeds);
  meet(beyond.y, vec3(j.x, i.y, j.z), seeds);
  meet(beyond.z, vec3(i.x, j.yz), seeds);
  meet(beyond.w, j, seeds);
  return vec2(sqrt(seeds.y) - sqrt(seeds.x), seeds.z / PERIOD);
}

#if NOISE == 6
vec3 imageAt(vec3 p)
{
  vec3 shares = turned * turned;
  shares *= shares;
  shares /= max(shares.x + shares.y + shares.z, 1e-12);
  vec2 up = vec2(1.0, -aspect);  // its first row is the upper one
  return shares.x * texture2D(image, p.yz * up).rgb + shares.y * texture2D(image, p.xz * up).rgb +
         shares.z * texture2D(image, p.xy * up).rgb;
}
#elif NOISE == 8
vec3 imageAt(vec3 p) { return texture2D(image, p.xy * vec2(1.0, -1.0)).rgb; }
#endif

// x: how full the pattern is; y: how high the surface stands, in cells; z: how full it is on the whole.
vec3 patternAt(vec3 p)
{
#if NOISE == 1
  float base = gradientNoise(p), vessel = 1.0 - smoothstep(0.02, 0.10, abs(base));
  float t = vessel * smoothstep(-0.15, 0.25, gradientNoise(0.37 * p + 7.3));
  return vec3(t, 0.15 * t + 0.1 * base, 0.15);
#elif NOISE == 2
  vec2 cell = cellsAt(p);
  float ground = 0.25 * cell.y + 0.5 * clamp(0.45 + gradientNoise(0.13 * p), 0.0, 1.0);
  return vec3(mix(ground, 1.0, 1.0 - smoothstep(0.0, 0.35, cell.x)), 0.3 * min(cell.x, 0.4), 0.6);
#elif NOISE == 3
  vec2 cell = cellsAt(p);
  return vec3(mix(0.3 * cell.y, 1.0, 1.0 - smoothstep(0.0, 0.14, cell.x)), 0.3 * smoothstep(0.0, 0.5, cell.x), 0.3);
#elif NOISE == 4
  vec3 strand = vec3(0.08 * p.x, p.yz);
  float t = clamp(0.5 + 0.8 * gradientNoise(strand) + 0.5 * gradientNoise(2.3 * strand), 0.0, 1.0);
  return vec3(t, -0.25 * t, 0.5);
#elif NOISE == 5
  float pit = smoothstep(0.2, 0.4, gradientNoise(p));
  return vec3(clamp(0.3 + 0.6 * gradientNoise(0.25 * p), 0.0, 0.5) + 0.5 * pit, -0.2 * pit, 0.35);
#else
  return vec3(0.0, 0.3 * gradientNoise(p), 0.0);
#endif
}

// --- light

// GGX: how much of a lamp is mirrored where the half vector is that far from the normal, over pi.
float mirrored(float cosine, float roughness)
{
  float a = roughness * roughness * roughness * roughness;
  float d = cosine * cosine * (a - 1.0) + 1.0;
  return a / (d * d);
}

// How much of the lamp above a tip hides: a spot below it, wider and fainter the farther it is.
float shadowOf(vec4 tip)
{
  float high = tip.z - at.z, wide = max(tip.w + 0.2 * high, 1e-6);
  return step(0.0, high) * tip.w / wide * (1.0 - smoothstep(0.3 * wide, wide, length(tip.xy - at.xy)));
}

void main()
{
  vec3 n = normalize(normal), eye = normalize(-seen_at), up = normalize(above);
  if (dot(n, eye) < 0.0) n = -n;  // shells are seen from both sides

  vec3 colour = gl_Color.rgb;
#if NOISE != 7
  vec3 p = place / scale;
  // Cells smaller than a pixel are their mean.
  vec3 width = fwidth(p);
  float coarse = smoothstep(0.5, 1.2, max(width.x, max(width.y, width.z)));
#if NOISE == 6 || NOISE == 8
  colour = imageAt(p);
  vec3 pattern = vec3(0.0, 0.03 * dot(colour, vec3(0.3, 0.6, 0.1)), 0.0);  // what is bright stands out
#else
  vec3 pattern = patternAt(p);
  colour = mix(colour, second.rgb, mix(pattern.x, pattern.z, coarse));
#endif
  // Mikkelsen 2010, Bump mapping unparametrized surfaces on the GPU.
  float height = bump * pattern.y;
  vec3 dx = dFdx(seen_at), dy = dFdy(seen_at);
#if NOISE == 8  // as wide as the image is here [m]
  vec2 px = dFdx(p.xy), py = dFdy(p.xy);
  float cell = sqrt(length(cross(dx, dy)) / max(abs(px.x * py.y - px.y * py.x), 1e-12));
#else
  float cell = scale;
#endif
  vec3 r1 = cross(dy, n), r2 = cross(n, dx);
  float area = dot(dx, r1);
  vec3 slope = cell * sign(area) * (dFdx(height) * r1 + dFdy(height) * r2) / max(abs(area), 1e-12);
  n = normalize(n - (1.0 - coarse) * slope);
#endif

  // Stretched or pressed in, tissue holds less blood.
  float blanched = max(0.5 * smoothstep(1.15, 2.0, growth), 0.8 * pressed);
  colour = mix(colour, vec3(0.55, 0.48, 0.44) + 0.45 * colour, blanched);

  float facing = max(dot(n, eye), 0.0), raised = dot(n, up);
  float bloody = 1.0 - smoothstep(0.2 * RIM, RIM, from_rim);
  colour *= mix(vec3(1.0), vec3(0.72, 0.42, 0.42), bloody);
  float wet = mix(wetness, 1.0, 0.7 * bloody);

  vec3 lit = colour * (0.28 + 0.50 * facing + 0.16 * (1.0 + raised));
  lit.r += 0.05 * colour.r * (1.0 - facing);  // light that has gone through tissue is red

  float shadow = max(max(shadowOf(tips[0]), shadowOf(tips[1])), max(shadowOf(tips[2]), shadowOf(tips[3])));
  lit *= 1.0 - 0.65 * shadow * smoothstep(0.0, 0.2, raised);

  float rim = (1.0 - facing) * (1.0 - facing), roughness = mix(0.75, 0.22, wet);
  vec3 half_up = normalize(eye + up);
  float film = 0.010 * mirrored(facing, roughness) +
               0.008 * mirrored(max(dot(n, half_up), 0.0), roughness) * step(0.0, raised) +
               0.12 * rim * rim;
  gl_FragColor = vec4(lit + vec3(0.95, 0.97, 1.0) * wet * min(film, 0.9), gl_Color.a);
}
