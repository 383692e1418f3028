// Vectorised steps of bodies, lanes across bodies, compiled once for each instruction set: the including file sets the
// target, MESHLESS_SET and the width of a vector. What is computed for a lane never depends on another lane;
// branches only leave out work that no lane needs.
#ifndef MESHLESS_SET
#error "set MESHLESS_SET and MESHLESS_BYTES before including match_batch_kernel.h"
#endif

namespace meshless::match_sets::MESHLESS_SET {
namespace {

#define MESHLESS_INLINE inline __attribute__((always_inline))

typedef float Pack __attribute__((vector_size(MESHLESS_BYTES)));
typedef int Mask __attribute__((vector_size(MESHLESS_BYTES)));

constexpr int kLanes = MESHLESS_BYTES / 4;

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
      map[3 * r + k] = choose(has, share * out[k], fitted * fit[3 * r + k]) + rigid * get(s.rotation[3 * r + k] + slot);
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
  // Sums of the new state are taken from where its centre goes, so that they lose nothing far from the origin.
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
    const Vector moved = {x.x + h * v.x - shift.x, x.y + h * v.y - shift.y, x.z + h * v.z - shift.z};
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

}  // namespace meshless::match_sets::MESHLESS_SET
