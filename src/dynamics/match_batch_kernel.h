// Vectorised steps of bodies and of overlapping clusters, compiled once for each instruction set: the including file
// sets the target, MESHLESS_MATCH_SET and the width of a vector. What is computed for a lane never depends on another
// lane; branches only leave out work that no lane needs.
#ifndef MESHLESS_MATCH_SET
#error "set MESHLESS_MATCH_SET and MESHLESS_MATCH_BYTES before including match_batch_kernel.h"
#endif

namespace meshless::match_sets::MESHLESS_MATCH_SET {
namespace {

#define MESHLESS_INLINE inline __attribute__((always_inline))

typedef float Pack __attribute__((vector_size(MESHLESS_MATCH_BYTES)));
typedef int Mask __attribute__((vector_size(MESHLESS_MATCH_BYTES)));
typedef float Quad __attribute__((vector_size(16)));
typedef int QuadMask __attribute__((vector_size(16)));

constexpr int kLanes = MESHLESS_MATCH_BYTES / 4;
constexpr int kRowPacks = kLanes == 4 ? 3 : 16 / kLanes;  // vectors that cover the 12 numbers of a row

constexpr float kFullBetaDeterminant = 0.1f;  // as in shape_matching.cpp
constexpr int kVolumeSteps = 4;               // likewise
constexpr float kLeastGradient = 1e-30f;      // where a map has no volume to hold, nothing is divided by 0
constexpr float kLeastSlope = 1e-3f;          // of the first step's
constexpr float kLeastShare = 1e-6f;          // below, what is cubed leaves the range of a float
constexpr float kLineDeterminant = 1e-4f;     // of the inertia over its trace: nearly a line below it
constexpr float kFarFromOrigin = 0.5f;        // of the body's size

MESHLESS_INLINE Pack get(const float* from) {
  Pack x;
  __builtin_memcpy(&x, from, sizeof(x));
  return x;
}
MESHLESS_INLINE void put(Pack x, float* to) { __builtin_memcpy(to, &x, sizeof(x)); }
MESHLESS_INLINE Quad getQuad(const float* from) {
  Quad x;
  __builtin_memcpy(&x, from, sizeof(x));
  return x;
}
MESHLESS_INLINE void putQuad(Quad x, float* to) { __builtin_memcpy(to, &x, sizeof(x)); }
MESHLESS_INLINE Pack all(float x) { return Pack{} + x; }
MESHLESS_INLINE Pack choose(Mask m, Pack yes, Pack no) { return m ? yes : no; }
MESHLESS_INLINE Pack absolute(Pack x) { return (Pack)((Mask)x & 0x7fffffff); }
MESHLESS_INLINE Pack larger(Pack x, Pack y) { return x > y ? x : y; }
MESHLESS_INLINE Pack smaller(Pack x, Pack y) { return x < y ? x : y; }
MESHLESS_INLINE bool any(Mask m) {
  int sum = 0;
  for (int l = 0; l < kLanes; ++l) sum |= m[l];
  return sum != 0;
}
MESHLESS_INLINE Pack squareRoot(Pack x) {
#if MESHLESS_MATCH_BYTES == 64
  return _mm512_maskz_sqrt_ps(0xffff, x);  // the unmasked one warns of an uninitialised value with GCC 12
#elif MESHLESS_MATCH_BYTES == 32
  return _mm256_sqrt_ps(x);
#elif MESHLESS_ROTATION_X86
  return _mm_sqrt_ps(x);
#else
  for (int l = 0; l < kLanes; ++l) x[l] = __builtin_sqrtf(x[l]);
  return x;
#endif
}

struct Vector {
  Pack x, y, z;
};
MESHLESS_INLINE Vector cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
struct Symmetric {
  Pack xx, yy, zz, xy, yz, zx;
};
MESHLESS_INLINE Vector times(const Symmetric& m, const Vector& a) {
  return {m.xx * a.x + m.xy * a.y + m.zx * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.zx * a.x + m.yz * a.y + m.zz * a.z};
}

// a times a symmetric matrix; the best affine map of the moment.
MESHLESS_INLINE void timesSymmetric(const Pack (&a)[9], const Symmetric& m, Pack (&f)[9]) {
  for (int r = 0; r < 3; ++r) {
    const Pack x = a[3 * r], y = a[3 * r + 1], z = a[3 * r + 2];
    f[3 * r] = x * m.xx + y * m.xy + z * m.zx;
    f[3 * r + 1] = x * m.xy + y * m.yy + z * m.yz;
    f[3 * r + 2] = x * m.zx + y * m.yz + z * m.zz;
  }
}
MESHLESS_INLINE Pack determinantOf(const Pack (&f)[9]) {
  return f[0] * (f[4] * f[8] - f[5] * f[7]) + f[1] * (f[5] * f[6] - f[3] * f[8]) + f[2] * (f[3] * f[7] - f[4] * f[6]);
}

// --- bodies of one cluster, lanes across bodies

// A body's rigid motion.
struct Motion {
  Vector centre, velocity, spin;
};
MESHLESS_INLINE Vector getVector(const float* from) { return {get(from), get(from + kBlock), get(from + 2 * kBlock)}; }
MESHLESS_INLINE void putVector(const Vector& a, float* to) {
  put(a.x, to), put(a.y, to + kBlock), put(a.z, to + 2 * kBlock);
}
MESHLESS_INLINE Motion motionOf(const BodiesView& view, int block, int lane) {
  const float* const from = view.motion + static_cast<std::size_t>(block) * kMotionFields * kBlock + lane;
  return {getVector(from + kMotionCentre * kBlock), getVector(from + kMotionVelocity * kBlock),
          getVector(from + kMotionSpin * kBlock)};
}

// Where the match sees a particle, from where the centre of mass will be, and what of its velocity deforms, undamped.
struct Prediction {
  Vector r, deforming, y;
};
MESHLESS_INLINE Prediction predict(const Motion& body, const StepNumbers& step, const Vector& x, const Vector& v) {
  Prediction p;
  p.r = {x.x - body.centre.x, x.y - body.centre.y, x.z - body.centre.z};
  const Vector turning = cross(body.spin, p.r);
  p.deforming = {v.x - body.velocity.x - turning.x, v.y - body.velocity.y - turning.y,
                 v.z - body.velocity.z - turning.z};
  const float ahead = step.ahead * (1.0f - step.lost);
  p.y = {p.r.x + (step.h * turning.x + ahead * p.deforming.x), p.r.y + (step.h * turning.y + ahead * p.deforming.y),
         p.r.z + (step.h * turning.z + ahead * p.deforming.z)};
  return p;
}

template <bool kQuadratic>
void gather(const BodiesView& view, const StepNumbers& step, int block, int lane, int slot, BodiesScratch& s) {
  const int n = view.particles;
  const float* field = view.fields + static_cast<std::size_t>(block) * n * kParticleFields * kBlock + lane;
  const float* const quadratic =
      kQuadratic ? view.quadratic + static_cast<std::size_t>(block) * kQuadraticFields * kBlock + lane : nullptr;
  Pack mean[6] = {};
  if (kQuadratic)
    for (int k = 0; k < 6; ++k) mean[k] = get(quadratic + k * kBlock);
  Pack moment[9] = {}, second[18] = {};
  const Motion body = motionOf(view, block, lane);
  for (int i = 0; i < n; ++i, field += kParticleFields * kBlock) {
    const Pack m = get(field + kMass * kBlock);
    const Vector v = {get(field + kVx * kBlock), get(field + kVy * kBlock), get(field + kVz * kBlock)};
    const Vector x = {get(field + kX * kBlock), get(field + kY * kBlock), get(field + kZ * kBlock)};
    const Vector q = {get(field + kQx * kBlock), get(field + kQy * kBlock), get(field + kQz * kBlock)};
    const Vector at = predict(body, step, x, v).y;
    const Pack y[3] = {m * at.x, m * at.y, m * at.z};
    for (int r = 0; r < 3; ++r) {
      moment[3 * r] += y[r] * q.x;
      moment[3 * r + 1] += y[r] * q.y;
      moment[3 * r + 2] += y[r] * q.z;
    }
    if (kQuadratic) {
      const Pack b[6] = {q.x * q.x - mean[0], q.y * q.y - mean[1], q.z * q.z - mean[2],
                         q.x * q.y - mean[3], q.y * q.z - mean[4], q.z * q.x - mean[5]};
      for (int r = 0; r < 3; ++r)
        for (int k = 0; k < 6; ++k) second[6 * r + k] += y[r] * b[k];
    }
  }
  for (int k = 0; k < 9; ++k) put(moment[k], s.moment[k] + slot);
  if (kQuadratic)
    for (int k = 0; k < 18; ++k) put(second[k], s.second[k] + slot);
}

// Inverse of the inertia; lanes that are nearly a line are left to the plain code.
MESHLESS_INLINE Symmetric inverseInertia(const BodiesView& view, const Symmetric& moment) {
  const Pack trace = 2.0f * (moment.xx + moment.yy + moment.zz);
  const Pack scale = choose(trace > 0.0f, 1.0f / trace, all(0.0f));
  const Symmetric i = {(moment.yy + moment.zz) * scale,
                       (moment.zz + moment.xx) * scale,
                       (moment.xx + moment.yy) * scale,
                       -moment.xy * scale,
                       -moment.yz * scale,
                       -moment.zx * scale};
  Symmetric c = {i.yy * i.zz - i.yz * i.yz, i.zz * i.xx - i.zx * i.zx, i.xx * i.yy - i.xy * i.xy,
                 i.yz * i.zx - i.xy * i.zz, i.zx * i.xy - i.yz * i.xx, i.xy * i.yz - i.zx * i.yy};
  const Pack determinant = i.xx * c.xx + i.xy * c.xy + i.zx * c.zx;
  const Pack factor = scale / determinant;
  c.xx *= factor, c.yy *= factor, c.zz *= factor, c.xy *= factor, c.yz *= factor, c.zx *= factor;
  const Mask line = determinant < kLineDeterminant;
  if (any(line)) {
    for (int l = 0; l < kLanes; ++l) {
      if (!line[l]) continue;
      const float from[6] = {i.xx[l], i.yy[l], i.zz[l], i.xy[l], i.yz[l], i.zx[l]};
      float to[6];
      view.pseudoInverse(from, to);
      c.xx[l] = to[0] * scale[l], c.yy[l] = to[1] * scale[l], c.zz[l] = to[2] * scale[l];
      c.xy[l] = to[3] * scale[l], c.yz[l] = to[4] * scale[l], c.zx[l] = to[5] * scale[l];
    }
  }
  return c;
}

// The rigid motion of bodies whose particles were put somewhere from outside.
void measure(const BodiesView& view, int block, int lane) {
  const int n = view.particles;
  const float* const fields = view.fields + static_cast<std::size_t>(block) * n * kParticleFields * kBlock + lane;
  float* const motion = view.motion + static_cast<std::size_t>(block) * kMotionFields * kBlock + lane;
  Vector centre = {}, mean = {};
  Pack total = {};
  const float* field = fields;
  for (int i = 0; i < n; ++i, field += kParticleFields * kBlock) {
    const Pack m = get(field + kMass * kBlock);
    const Vector x = getVector(field + kX * kBlock), v = getVector(field + kVx * kBlock);
    centre.x += m * x.x, centre.y += m * x.y, centre.z += m * x.z;
    mean.x += m * v.x, mean.y += m * v.y, mean.z += m * v.z;
    total += m;
  }
  const Pack share = 1.0f / total;
  centre.x *= share, centre.y *= share, centre.z *= share;
  mean.x *= share, mean.y *= share, mean.z *= share;
  Vector turning = {};
  Symmetric moment = {};
  field = fields;
  for (int i = 0; i < n; ++i, field += kParticleFields * kBlock) {
    const Pack m = get(field + kMass * kBlock);
    const Vector x = getVector(field + kX * kBlock), v = getVector(field + kVx * kBlock);
    const Vector r = {x.x - centre.x, x.y - centre.y, x.z - centre.z};
    const Vector mr = {m * r.x, m * r.y, m * r.z};
    const Vector l = cross(mr, {v.x - mean.x, v.y - mean.y, v.z - mean.z});
    turning.x += l.x, turning.y += l.y, turning.z += l.z;
    moment.xx += mr.x * r.x, moment.yy += mr.y * r.y, moment.zz += mr.z * r.z;
    moment.xy += mr.x * r.y, moment.yz += mr.y * r.z, moment.zx += mr.z * r.x;
  }
  const Symmetric inverse = inverseInertia(view, moment);
  putVector(centre, motion + kMotionCentre * kBlock);
  putVector(mean, motion + kMotionVelocity * kBlock);
  putVector(times(inverse, turning), motion + kMotionSpin * kBlock);
  putVector({inverse.xx, inverse.yy, inverse.zz}, motion + kMotionInverse * kBlock);
  putVector({inverse.xy, inverse.yz, inverse.zx}, motion + (kMotionInverse + 3) * kBlock);
}

MESHLESS_INLINE void cofactorsOf(const Pack (&a)[9], Pack (&c)[9]) {
  for (int r = 0; r < 3; ++r) {
    const Pack* const u = a + 3 * ((r + 1) % 3);
    const Pack* const v = a + 3 * ((r + 2) % 3);
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      c[3 * r + k] = u[i] * v[j] - u[j] * v[i];
    }
  }
}

// A fitted map becomes the one of the goal, see withVolumeOfRest() in shape_matching.cpp; returns its share.
MESHLESS_INLINE Pack holdVolume(const StepNumbers& step, const Symmetric& inverse, Pack (&fit)[9]) {
  const Pack determinant = determinantOf(fit);
  Pack cofactors[9], gradient[9], second[9];
  cofactorsOf(fit, cofactors);
  timesSymmetric(cofactors, inverse, gradient);
  Pack c1 = all(kLeastGradient);
  for (int k = 0; k < 9; ++k) c1 += gradient[k] * cofactors[k];
  // In units of a first step by the whole volume, so that nothing is too large or small for floats.
  const Pack unit = 1.0f / c1;
  for (int k = 0; k < 9; ++k) gradient[k] *= unit;
  cofactorsOf(gradient, second);
  Pack c2 = all(0.0f), c3 = all(0.0f);
  for (int k = 0; k < 9; ++k) c2 += fit[k] * second[k];
  for (int k = 0; k < 3; ++k) c3 += gradient[k] * second[k];
  c2 = larger(c2, all(0.0f)), c3 = larger(c3, all(0.0f));  // below by rounding alone where there is any volume
  const Pack full = larger(all(0.0f), smaller(all(1.0f), determinant * (1.0f / kFullBetaDeterminant)));
  Pack t = all(0.0f);
  for (int n = 0; n < kVolumeSteps; ++n) {
    const Pack value = determinant - t * (1.0f - t * (c2 - t * c3));
    const Pack slope = 1.0f - t * (2.0f * c2 - 3.0f * t * c3);
    t += (value - full) / larger(slope, all(kLeastSlope));
  }
  t = choose(full > kLeastShare, t, all(0.0f));
  for (int k = 0; k < 9; ++k) fit[k] -= t * gradient[k];
  return step.beta * full;
}

// The goal's map of q in units of the size: 3 x 3, and 3 x 6 of the second order.
template <bool kFit, bool kQuadratic>
MESHLESS_INLINE void goalMap(const BodiesView& view, const StepNumbers& step, const BodiesScratch& s, int block,
                             int lane, int slot, Pack (&map)[9], Pack (&bend)[18]) {
  const float* const constant = view.constants + static_cast<std::size_t>(block) * kBodyFields * kBlock + lane;
  const Pack size = get(constant + kSize * kBlock);
  if (!kFit) {
    for (int k = 0; k < 9; ++k) map[k] = size * get(s.rotation[k] + slot);
    return;
  }
  Pack moment[9], fit[9];
  for (int k = 0; k < 9; ++k) moment[k] = get(s.moment[k] + slot);
  const float* const from = constant + kMoment * kBlock;
  const Symmetric inverse = {get(from),
                             get(from + kBlock),
                             get(from + 2 * kBlock),
                             get(from + 3 * kBlock),
                             get(from + 4 * kBlock),
                             get(from + 5 * kBlock)};
  timesSymmetric(moment, inverse, fit);
  const Pack share = holdVolume(step, inverse, fit);
  const Pack rigid = (1.0f - share) * size;
  const Pack fitted = share * size;
  if (!kQuadratic) {
    for (int k = 0; k < 9; ++k) map[k] = fitted * fit[k] + rigid * get(s.rotation[k] + slot);
    return;
  }
  const float* const triangle =
      view.quadratic + (static_cast<std::size_t>(block) * kQuadraticFields + 6) * kBlock + lane;
  const Mask has = get(constant + kHasQuadratic * kBlock) > 0.0f;
  const Pack quadratic_share = choose(has, share, all(0.0f));
  for (int r = 0; r < 3; ++r) {
    Pack row[9], out[9] = {};
    for (int k = 0; k < 3; ++k) row[k] = moment[3 * r + k];
    for (int k = 0; k < 6; ++k) row[3 + k] = get(s.second[6 * r + k] + slot);
    int entry = 0;
    for (int a = 0; a < 9; ++a)
      for (int b = a; b < 9; ++b, ++entry) {
        const Pack m = get(triangle + entry * kBlock);
        out[a] += m * row[b];
        if (a != b) out[b] += m * row[a];
      }
    for (int k = 0; k < 3; ++k)
      map[3 * r + k] =
          choose(has, share * out[k], fitted * fit[3 * r + k]) + rigid * get(s.rotation[3 * r + k] + slot);
    for (int k = 0; k < 6; ++k) bend[6 * r + k] = quadratic_share * out[3 + k];
  }
}

template <bool kFit, bool kQuadratic>
void move(const BodiesView& view, const StepNumbers& step, int block, int lane, int slot, BodiesScratch& s) {
  const int n = view.particles;
  float* const fields = view.fields + static_cast<std::size_t>(block) * n * kParticleFields * kBlock + lane;
  const float* const constant = view.constants + static_cast<std::size_t>(block) * kBodyFields * kBlock + lane;
  float* const motion = view.motion + static_cast<std::size_t>(block) * kMotionFields * kBlock + lane;
  const Motion body = motionOf(view, block, lane);
  const Vector& centre = body.centre;
  Vector restore = {}, excess = {};
  if (step.pull > 0.0f || step.lost > 0.0f) {
    Vector leaked = {}, pushed = {};
    Pack map[9], bend[18] = {}, basis_mean[6] = {};
    goalMap<kFit, kQuadratic>(view, step, s, block, lane, slot, map, bend);
    if (kQuadratic)
      for (int k = 0; k < 6; ++k)
        basis_mean[k] = get(view.quadratic + (static_cast<std::size_t>(block) * kQuadraticFields + k) * kBlock + lane);
    float* field = fields;
    for (int i = 0; i < n; ++i, field += kParticleFields * kBlock) {
      const Pack m = get(field + kMass * kBlock);
      const Vector v = getVector(field + kVx * kBlock), q = getVector(field + kQx * kBlock);
      const Prediction p = predict(body, step, getVector(field + kX * kBlock), v);
      Vector goal = {map[0] * q.x + map[1] * q.y + map[2] * q.z, map[3] * q.x + map[4] * q.y + map[5] * q.z,
                     map[6] * q.x + map[7] * q.y + map[8] * q.z};
      if (kQuadratic) {
        const Pack b[6] = {q.x * q.x - basis_mean[0], q.y * q.y - basis_mean[1], q.z * q.z - basis_mean[2],
                           q.x * q.y - basis_mean[3], q.y * q.z - basis_mean[4], q.z * q.x - basis_mean[5]};
        for (int k = 0; k < 6; ++k)
          goal.x += bend[k] * b[k], goal.y += bend[6 + k] * b[k], goal.z += bend[12 + k] * b[k];
      }
      // What deforms has no momentum of its own but for rounding, which is taken off with what the pull leaks.
      const Vector dv = {step.pull * (goal.x - p.y.x) - step.lost * p.deforming.x,
                         step.pull * (goal.y - p.y.y) - step.lost * p.deforming.y,
                         step.pull * (goal.z - p.y.z) - step.lost * p.deforming.z};
      const Vector mdv = {m * dv.x, m * dv.y, m * dv.z};
      const Vector l = cross(p.r, mdv);
      leaked.x += l.x, leaked.y += l.y, leaked.z += l.z;
      pushed.x += mdv.x, pushed.y += mdv.y, pushed.z += mdv.z;
      putVector({v.x + dv.x, v.y + dv.y, v.z + dv.z}, field + kVx * kBlock);
    }
    const float* const from = motion + kMotionInverse * kBlock;
    const Symmetric inverse = {get(from),
                               get(from + kBlock),
                               get(from + 2 * kBlock),
                               get(from + 3 * kBlock),
                               get(from + 4 * kBlock),
                               get(from + 5 * kBlock)};
    restore = times(inverse, leaked);
    excess = pushed;  // 0 but for rounding, which would add up over many steps
  }
  const Pack far = kFarFromOrigin * get(constant + kSize * kBlock);
  const Mask is_far = (absolute(centre.x) > far) | (absolute(centre.y) > far) | (absolute(centre.z) > far);
  const Vector shift = {choose(is_far, centre.x, all(0.0f)), choose(is_far, centre.y, all(0.0f)),
                        choose(is_far, centre.z, all(0.0f))};
  put(shift.x, s.shift[0] + slot), put(shift.y, s.shift[1] + slot), put(shift.z, s.shift[2] + slot);

  const float h = step.h;
  const Vector drift = {h * step.gravity[0] - excess.x, h * step.gravity[1] - excess.y, h * step.gravity[2] - excess.z};
  const Pack ground = get(constant + kGround * kBlock);
  // Sums of the new state are taken from where it is without the ground, so that they lose nothing far from there.
  const Vector mean = {body.velocity.x + h * step.gravity[0], body.velocity.y + h * step.gravity[1],
                       body.velocity.z + h * step.gravity[2]};
  const Vector to = {centre.x + h * mean.x - shift.x, centre.y + h * mean.y - shift.y, centre.z + h * mean.z - shift.z};
  Vector off = {}, faster = {}, turning = {};
  Symmetric moment = {};
  float* field = fields;
  for (int i = 0; i < n; ++i, field += kParticleFields * kBlock) {
    const Pack m = get(field + kMass * kBlock);
    Vector v = getVector(field + kVx * kBlock);
    const Vector x = getVector(field + kX * kBlock);
    const Vector turn = cross(restore, {x.x - centre.x, x.y - centre.y, x.z - centre.z});
    v.x += drift.x - turn.x, v.y += drift.y - turn.y, v.z += drift.z - turn.z;
    Pack z = x.z + h * v.z;
    if (step.ground) {
      const Mask inside = z < ground;
      if (any(inside)) {
        // As friction at the ground and velocities from positions would leave it; a push out of it never throws.
        const Pack length = h * squareRoot(v.x * v.x + v.y * v.y);
        const Pack cone = step.friction * (ground - z);
        const Pack slide = choose(length > cone, 1.0f - cone / length, all(0.0f));
        v.x = choose(inside, slide * v.x, v.x), v.y = choose(inside, slide * v.y, v.y);
        v.z = choose(inside, smaller((ground - x.z) * (1.0f / h), larger(v.z, all(0.0f))), v.z);
        z = choose(inside, ground, z);
      }
    }
    const Vector moved = {x.x + h * v.x - shift.x, x.y + h * v.y - shift.y, z - shift.z};
    putVector(v, field + kVx * kBlock), putVector(moved, field + kX * kBlock);
    const Vector r = {moved.x - to.x, moved.y - to.y, moved.z - to.z};
    const Vector mr = {m * r.x, m * r.y, m * r.z};
    const Vector w = {v.x - mean.x, v.y - mean.y, v.z - mean.z};
    const Vector l = cross(mr, w);
    off.x += mr.x, off.y += mr.y, off.z += mr.z;
    faster.x += m * w.x, faster.y += m * w.y, faster.z += m * w.z;
    turning.x += l.x, turning.y += l.y, turning.z += l.z;
    moment.xx += mr.x * r.x, moment.yy += mr.y * r.y, moment.zz += mr.z * r.z;
    moment.xy += mr.x * r.y, moment.yz += mr.y * r.z, moment.zx += mr.z * r.x;
  }
  moment.xx -= off.x * off.x, moment.yy -= off.y * off.y, moment.zz -= off.z * off.z;
  moment.xy -= off.x * off.y, moment.yz -= off.y * off.z, moment.zx -= off.z * off.x;
  const Vector l = cross(off, faster);
  const Symmetric inverse = inverseInertia(view, moment);
  putVector({to.x + off.x, to.y + off.y, to.z + off.z}, motion + kMotionCentre * kBlock);
  putVector({mean.x + faster.x, mean.y + faster.y, mean.z + faster.z}, motion + kMotionVelocity * kBlock);
  putVector(times(inverse, {turning.x - l.x, turning.y - l.y, turning.z - l.z}), motion + kMotionSpin * kBlock);
  putVector({inverse.xx, inverse.yy, inverse.zz}, motion + kMotionInverse * kBlock);
  putVector({inverse.xy, inverse.yz, inverse.zx}, motion + (kMotionInverse + 3) * kBlock);
}

// --- overlapping clusters, lanes across particles or clusters, and rows of 12 numbers for their pairs

MESHLESS_INLINE void transpose(Quad& a, Quad& b, Quad& c, Quad& d) {
#ifdef __clang__  // of the fuzzers
#define MESHLESS_SHUFFLE(x, y, ...) __builtin_shufflevector(x, y, __VA_ARGS__)
#else
#define MESHLESS_SHUFFLE(x, y, ...) __builtin_shuffle(x, y, QuadMask{__VA_ARGS__})
#endif
  const Quad ab = MESHLESS_SHUFFLE(a, b, 0, 4, 1, 5), cd = MESHLESS_SHUFFLE(c, d, 0, 4, 1, 5);
  const Quad ef = MESHLESS_SHUFFLE(a, b, 2, 6, 3, 7), gh = MESHLESS_SHUFFLE(c, d, 2, 6, 3, 7);
  a = MESHLESS_SHUFFLE(ab, cd, 0, 1, 4, 5), b = MESHLESS_SHUFFLE(ab, cd, 2, 3, 6, 7);
  c = MESHLESS_SHUFFLE(ef, gh, 0, 1, 4, 5), d = MESHLESS_SHUFFLE(ef, gh, 2, 3, 6, 7);
#undef MESHLESS_SHUFFLE
}

// Four rows of 12 numbers as columns of [12][kChunk].
MESHLESS_INLINE void spreadRows(const float (&rows)[4][16], std::size_t column, float (&to)[12][kChunk]) {
  for (int r = 0; r < 3; ++r) {
    Quad a = getQuad(rows[0] + 4 * r), b = getQuad(rows[1] + 4 * r);
    Quad c = getQuad(rows[2] + 4 * r), d = getQuad(rows[3] + 4 * r);
    transpose(a, b, c, d);
    putQuad(a, to[4 * r] + column), putQuad(b, to[4 * r + 1] + column), putQuad(c, to[4 * r + 2] + column);
    putQuad(d, to[4 * r + 3] + column);
  }
}

// Sum of rows; four partial sums, because a sum of one would wait for itself.
template <bool kWeighted, class Short>
MESHLESS_INLINE void sumRows(const float* rows, const Short* index, const float* weight, std::uint32_t begin,
                             std::uint32_t end, float* to) {
  constexpr int kParts = kRowPacks == 1 ? 4 : 2;
  Pack sum[kParts][kRowPacks] = {};
  std::uint32_t k = begin;
  for (; k + kParts <= end; k += kParts)
#pragma GCC unroll 4
    for (int part = 0; part < kParts; ++part) {
      const float* const from = rows + 16 * static_cast<std::size_t>(index[k + part]);
#pragma GCC unroll 4
      for (int p = 0; p < kRowPacks; ++p)
        sum[part][p] += kWeighted ? weight[k + part] * get(from + p * kLanes) : get(from + p * kLanes);
    }
  for (; k < end; ++k) {
    const float* const from = rows + 16 * static_cast<std::size_t>(index[k]);
#pragma GCC unroll 4
    for (int p = 0; p < kRowPacks; ++p)
      sum[0][p] += kWeighted ? weight[k] * get(from + p * kLanes) : get(from + p * kLanes);
  }
#pragma GCC unroll 4
  for (int p = 0; p < kRowPacks; ++p) {
    if (kParts == 4) sum[0][p] = (sum[0][p] + sum[1][p]) + (sum[kParts - 2][p] + sum[kParts - 1][p]);
    if (kParts == 2) sum[0][p] += sum[1][p];
    put(sum[0][p], to + p * kLanes);
  }
}

// Replaces each of the n rows, `stride` floats apart, by the sum over those at most `width` rows away, whatever the
// width at three additions a row (van Herk 1992, for sums): the line is cut into blocks as long as the neighbourhood,
// which is then the end of one block and the beginning of the next. Nothing is ever taken off a sum.
MESHLESS_INLINE void sumLine(float* rows, std::size_t stride, std::size_t n, std::size_t width, float* line) {
  const std::size_t length = 2 * width + 1;
  const std::size_t end = n + width, places = n + 2 * width;  // row i is at place i + width, others are 0
#pragma GCC unroll 4
  for (int p = 0; p < kRowPacks; ++p) {
    float* const row = rows + p * kLanes;
    float* const tail = line + p * kLanes;  // of place i: the sum from there to the end of its block
    for (std::size_t block = 0; block < places; block += length) {
      Pack sum = {};
      std::size_t at = block + length < end ? block + length : end;
      for (; at > block && at > width; --at) {
        sum += get(row + (at - 1 - width) * stride);
        if (at - 1 < n) put(sum, tail + 16 * (at - 1));
      }
      for (; at > block; --at)
        if (at - 1 < n) put(sum, tail + 16 * (at - 1));
      if (block > 0) {  // in place: what is overwritten was read `width` rows ago, or by the tails
        const std::size_t last = block + length - 1 < places ? block + length - 1 : places;
        sum = Pack{};
        for (at = block; at < last; ++at) {
          if (at < end) sum += get(row + (at - width) * stride);
          const std::size_t i = at + 1 - length;
          put(get(tail + 16 * i) + sum, row + i * stride);
        }
      }
      if (block < n) put(get(tail + 16 * block), row + block * stride);
    }
  }
}

// Rows summed over the layers of a lattice for `count` (a multiple of 4) consumers, as [12][kChunk].
void sumLayers(const OverlapView& view, const float* rows, std::size_t first, std::size_t count,
               float (&to)[12][kChunk]) {
  for (std::size_t i = 0; i < count; i += 4) {
    alignas(64) float sums[4][16];
    for (int j = 0; j < 4; ++j) {
      Pack sum[kRowPacks] = {};
      const float* from = rows + 16 * static_cast<std::size_t>(view.layer_begin[first + i + j]);
      for (std::uint32_t k = view.layer_count[first + i + j]; k > 0; --k, from += 16 * view.layer)
#pragma GCC unroll 4
        for (int p = 0; p < kRowPacks; ++p) sum[p] += get(from + p * kLanes);
#pragma GCC unroll 4
      for (int p = 0; p < kRowPacks; ++p) put(sum[p], sums[j] + p * kLanes);
    }
    spreadRows(sums, i, to);
  }
}

// Rows summed for `count` (a multiple of 4) consumers, as [12][kChunk].
template <bool kWeighted, class Short>
void sumAll(const float* rows, const std::uint32_t* offsets, const Short* index, const float* weight, std::size_t first,
            std::size_t count, float (&to)[12][kChunk]) {
  for (std::size_t i = 0; i < count; i += 4) {
    alignas(64) float sums[4][16];
    for (int j = 0; j < 4; ++j)
      sumRows<kWeighted>(rows, index, weight, offsets[first + i + j], offsets[first + i + j + 1], sums[j]);
    spreadRows(sums, i, to);
  }
}

void sumPairs(const float* rows, const std::uint32_t* offsets, const std::uint16_t* short_index,
              const std::uint32_t* long_index, const float* weight, std::size_t first, std::size_t count,
              float (&to)[12][kChunk]) {
  if (short_index && weight) return sumAll<true>(rows, offsets, short_index, weight, first, count, to);
  if (short_index) return sumAll<false>(rows, offsets, short_index, weight, first, count, to);
  if (weight) return sumAll<true>(rows, offsets, long_index, weight, first, count, to);
  sumAll<false>(rows, offsets, long_index, weight, first, count, to);
}

MESHLESS_INLINE void rigidVelocity(const OverlapMotion& motion, const Vector& x, Pack (&together)[3]) {
  const Vector turning = cross({all(motion.spin[0]), all(motion.spin[1]), all(motion.spin[2])},
                               {x.x - motion.centre[0], x.y - motion.centre[1], x.z - motion.centre[2]});
  together[0] = motion.velocity[0] + turning.x;
  together[1] = motion.velocity[1] + turning.y;
  together[2] = motion.velocity[2] + turning.z;
}
// Where the match sees a particle: what deforms goes a time of its own.
MESHLESS_INLINE Pack predict(const StepNumbers& step, Pack u, Pack v, Pack together) {
  return u + (step.h * together + step.ahead * (v - together));
}

MESHLESS_INLINE double total(Pack x) {
  double sum = 0.0;
  for (int l = 0; l < kLanes; ++l) sum += x[l];
  return sum;
}

}  // namespace

void measureBodies(const BodiesView& view, int first_block, int blocks) {
  for (int b = first_block; b < first_block + blocks; ++b)
    for (int lane = 0; lane < kBlock; lane += kLanes) measure(view, b, lane);
}

void gatherBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s) {
  for (int b = 0; b < blocks; ++b)
    for (int lane = 0; lane < kBlock; lane += kLanes)
      if (step.quadratic)
        gather<true>(view, step, first_block + b, lane, b * kBlock + lane, s);
      else
        gather<false>(view, step, first_block + b, lane, b * kBlock + lane, s);
}

void moveBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s) {
  for (int b = 0; b < blocks; ++b)
    for (int lane = 0; lane < kBlock; lane += kLanes)
      if (step.quadratic)
        move<true, true>(view, step, first_block + b, lane, b * kBlock + lane, s);
      else if (step.beta > 0.0f)
        move<true, false>(view, step, first_block + b, lane, b * kBlock + lane, s);
      else
        move<false, false>(view, step, first_block + b, lane, b * kBlock + lane, s);
}

void sumParticles(const OverlapView& view, std::size_t first, std::size_t count, double* sums) {
  const std::size_t n = view.particle_stride;
  Pack sum[kOverlapSums] = {};
  for (std::size_t i = first; i < first + count; i += kLanes) {
    const Pack m = get(view.mass + i);
    const Pack u[3] = {get(view.u + i), get(view.u + n + i), get(view.u + 2 * n + i)};
    const Pack v[3] = {get(view.v + i), get(view.v + n + i), get(view.v + 2 * n + i)};
    const Vector x = {get(view.rest + i) + u[0], get(view.rest + n + i) + u[1], get(view.rest + 2 * n + i) + u[2]};
    const Vector mx = {m * x.x, m * x.y, m * x.z};
    const Vector l = cross(mx, {v[0], v[1], v[2]});
    for (int k = 0; k < 3; ++k) sum[kSumX + k] += m * u[k], sum[kSumV + k] += m * v[k];
    sum[kSumMoment] += mx.x * x.x, sum[kSumMoment + 1] += mx.y * x.y, sum[kSumMoment + 2] += mx.z * x.z;
    sum[kSumMoment + 3] += mx.x * x.y, sum[kSumMoment + 4] += mx.y * x.z, sum[kSumMoment + 5] += mx.z * x.x;
    sum[kSumSpin] += l.x, sum[kSumSpin + 1] += l.y, sum[kSumSpin + 2] += l.z;
  }
  for (int k = 0; k < kOverlapSums; ++k) sums[k] = total(sum[k]);
}

void spreadParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion, std::size_t first,
                     std::size_t count) {
  const std::size_t n = view.particle_stride;
  for (std::size_t i = first; i < first + count; i += kLanes) {
    const Pack u[3] = {get(view.u + i), get(view.u + n + i), get(view.u + 2 * n + i)};
    Pack v[3] = {get(view.v + i), get(view.v + n + i), get(view.v + 2 * n + i)};
    const Vector x = {get(view.rest + i) + u[0], get(view.rest + n + i) + u[1], get(view.rest + 2 * n + i) + u[2]};
    Pack together[3];
    rigidVelocity(motion, x, together);
    if (step.lost > 0.0f)
      for (int k = 0; k < 3; ++k) {
        v[k] -= step.lost * (v[k] - together[k]);
        put(v[k], view.v + k * n + i);
      }
    if (!(step.pull > 0.0f)) continue;
    alignas(64) float y[3][kLanes];
    for (int k = 0; k < 3; ++k) put(predict(step, u[k], v[k], together[k]), y[k]);
    for (int l = 0; l < kLanes; ++l) {
      const Quad lever = getQuad(view.lever + 4 * (i + l));
      float* const row = view.moments + 16 * (view.sites ? view.sites[i + l] : i + l);
      putQuad(y[0][l] * lever, row), putQuad(y[1][l] * lever, row + 4), putQuad(y[2][l] * lever, row + 8);
    }
  }
}

void sumLayer(float* rows, std::size_t nx, std::size_t ny, std::size_t width, float* line) {
  for (std::size_t y = 0; y < ny; ++y) sumLine(rows + 16 * y * nx, 16, nx, width, line);
  for (std::size_t x = 0; x < nx; ++x) sumLine(rows + 16 * x, 16 * nx, ny, width, line);
}

void gatherClusters(const OverlapView& view, std::size_t first, std::size_t count, ClusterScratch& s) {
  alignas(64) float sums[12][kChunk];
  if (view.sites)
    sumLayers(view, view.moments, first, count, sums);
  else
    sumPairs(view.moments, view.member_offsets, view.short_members, view.long_members, view.member_weights, first,
             count, sums);
  const float* const constant = view.cluster_constants + first;
  const std::size_t n = view.cluster_stride;
  for (std::size_t i = 0; i < count; i += kLanes) {
    Pack rest[6], centre[3];
    for (int k = 0; k < 6; ++k) rest[k] = get(constant + (kRestMoment + k) * n + i);
    for (int k = 0; k < 3; ++k) centre[k] = get(constant + (kCentre + k) * n + i);
    const Pack inverse_mass = get(constant + kInverseMass * n + i);
    static constexpr int kEntry[9] = {0, 3, 5, 3, 1, 4, 5, 4, 2};
    for (int r = 0; r < 3; ++r) {
      const Pack su = get(sums[4 * r + 3] + i);
      put(su * inverse_mass, s.mean[r] + i);
      for (int k = 0; k < 3; ++k)
        put(rest[kEntry[3 * r + k]] + (get(sums[4 * r + k] + i) - su * centre[k]), s.moment[3 * r + k] + i);
    }
  }
}

void mapClusters(const OverlapView& view, const StepNumbers& step, std::size_t first, std::size_t count,
                 const ClusterScratch& s, double* quaternion_sum) {
  const float* const constant = view.cluster_constants + first;
  const std::size_t n = view.cluster_stride;
  Pack turn[4] = {};
  for (std::size_t i = 0; i < count; i += kLanes) {
    Pack map[9];
    for (int k = 0; k < 9; ++k) map[k] = get(s.rotation[k] + i);
    if (step.beta > 0.0f) {
      Pack moment[9], fit[9];
      for (int k = 0; k < 9; ++k) moment[k] = get(s.moment[k] + i);
      const float* const from = constant + kInverseMoment * n + i;
      const Symmetric inverse = {get(from),         get(from + n),     get(from + 2 * n),
                                 get(from + 3 * n), get(from + 4 * n), get(from + 5 * n)};
      timesSymmetric(moment, inverse, fit);
      const Pack share = holdVolume(step, inverse, fit);
      for (int k = 0; k < 9; ++k) map[k] = share * fit[k] + (1.0f - share) * map[k];
    }
    for (int k = 0; k < 9; k += 4) map[k] -= 1.0f;
    const Pack c0 = get(constant + kCentre * n + i), c1 = get(constant + (kCentre + 1) * n + i);
    const Pack c2 = get(constant + (kCentre + 2) * n + i);
    alignas(64) float rows[12][kLanes];
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) put(map[3 * r + k], rows[4 * r + k]);
      put(get(s.mean[r] + i) - (map[3 * r] * c0 + map[3 * r + 1] * c1 + map[3 * r + 2] * c2), rows[4 * r + 3]);
    }
    for (int l = 0; l < kLanes; l += 4)
      for (int r = 0; r < 3; ++r) {
        Quad a = getQuad(rows[4 * r] + l), b = getQuad(rows[4 * r + 1] + l);
        Quad c = getQuad(rows[4 * r + 2] + l), d = getQuad(rows[4 * r + 3] + l);
        transpose(a, b, c, d);
        const Quad columns[4] = {a, b, c, d};
        for (int j = 0; j < 4; ++j) {
          const std::size_t at = first + i + l + j;
          putQuad(columns[j], view.maps + 16 * (view.sites ? view.sites[at] : at) + 4 * r);
        }
      }
    const Pack w = get(view.quaternions + 3 * n + first + i);
    for (int k = 0; k < 4; ++k) {
      const Pack q = get(view.quaternions + k * n + first + i);
      turn[k] += choose(w < 0.0f, -q, q);
    }
  }
  for (int k = 0; k < 4; ++k) quaternion_sum[k] = total(turn[k]);
}

void pullParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion, std::size_t first,
                   std::size_t count, float* goals, double* leaked) {
  alignas(64) float sums[12][kChunk];
  if (view.sites)
    sumLayers(view, view.maps, first, count, sums);
  else
    sumPairs(view.maps, view.membership_offsets, view.short_memberships, view.long_memberships, view.membership_weights,
             first, count, sums);
  const std::size_t n = view.particle_stride;
  Vector lost = {};
  for (std::size_t i = 0; i < count; i += kLanes) {
    const std::size_t at = first + i;
    const Pack m = get(view.mass + at), share = get(view.share + at);
    const Pack x0[3] = {get(view.rest + at), get(view.rest + n + at), get(view.rest + 2 * n + at)};
    const Pack displaced[3] = {get(view.u + at), get(view.u + n + at), get(view.u + 2 * n + at)};
    const Vector x = {x0[0] + displaced[0], x0[1] + displaced[1], x0[2] + displaced[2]};
    Pack dv[3], together[3];
    rigidVelocity(motion, x, together);
    for (int k = 0; k < 3; ++k) {
      const Pack goal = share * (get(sums[4 * k] + i) * x0[0] + get(sums[4 * k + 1] + i) * x0[1] +
                                 get(sums[4 * k + 2] + i) * x0[2] + get(sums[4 * k + 3] + i));
      if (goals) put(goal, goals + k * n + at);
      const Pack v = get(view.v + k * n + at);
      dv[k] = step.pull * (goal - predict(step, displaced[k], v, together[k]));
      if (!goals) put(v + dv[k], view.v + k * n + at);
    }
    const Vector r = {m * (x.x - motion.centre[0]), m * (x.y - motion.centre[1]), m * (x.z - motion.centre[2])};
    const Vector l = cross(r, {dv[0], dv[1], dv[2]});
    lost.x += l.x, lost.y += l.y, lost.z += l.z;
  }
  leaked[0] = total(lost.x), leaked[1] = total(lost.y), leaked[2] = total(lost.z);
}

void moveParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion, std::size_t first,
                   std::size_t count) {
  const std::size_t n = view.particle_stride;
  const float h = step.h;
  const float drift[3] = {h * step.gravity[0], h * step.gravity[1], h * step.gravity[2]};
  const float* const normal = motion.normal;
  for (std::size_t i = first; i < first + count; i += kLanes) {
    const Pack u[3] = {get(view.u + i), get(view.u + n + i), get(view.u + 2 * n + i)};
    const Pack x[3] = {get(view.rest + i) + u[0], get(view.rest + n + i) + u[1], get(view.rest + 2 * n + i) + u[2]};
    const Vector turn = cross({all(motion.restore[0]), all(motion.restore[1]), all(motion.restore[2])},
                              {x[0] - motion.centre[0], x[1] - motion.centre[1], x[2] - motion.centre[2]});
    Pack v[3] = {get(view.v + i) + (drift[0] - turn.x), get(view.v + n + i) + (drift[1] - turn.y),
                 get(view.v + 2 * n + i) + (drift[2] - turn.z)};
    Pack step_of[3] = {h * v[0], h * v[1], h * v[2]};
    if (step.ground) {
      const Pack above = normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2] - motion.height;
      const Pack along = normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2];
      const Pack depth = -(above + h * along);
      const Mask inside = depth > 0.0f;
      if (any(inside)) {
        Pack side[3];
        for (int k = 0; k < 3; ++k) side[k] = v[k] - along * normal[k];
        const Pack length = h * squareRoot(side[0] * side[0] + side[1] * side[1] + side[2] * side[2]);
        const Pack cone = step.friction * depth;
        const Pack slide = choose(length > cone, 1.0f - cone / length, all(0.0f));
        const Pack rise = smaller(-above * (1.0f / h), larger(along, all(0.0f)));
        for (int k = 0; k < 3; ++k) {
          v[k] = choose(inside, slide * side[k] + rise * normal[k], v[k]);
          step_of[k] = choose(inside, h * slide * side[k] - above * normal[k], step_of[k]);
        }
      }
    }
    for (int k = 0; k < 3; ++k) put(v[k], view.v + k * n + i), put(u[k] + step_of[k], view.u + k * n + i);
  }
}

}  // namespace meshless::match_sets::MESHLESS_MATCH_SET
