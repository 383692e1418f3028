#include "meshless_surgery/appearance/look.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <tuple>

namespace meshless {
namespace {

constexpr double kPeriod = 289.0;  // cells: its permutations are exact in a shader's floats, too
constexpr double kJitter = 0.3;    // cells: how far a cell's seed is from its middle, at most, along each axis

double remainderOf(double x) { return x - std::floor(x / kPeriod) * kPeriod; }
double permuted(double x) { return remainderOf((34.0 * x + 1.0) * x); }
double hashOf(const Vec3& cell) {
  return permuted(permuted(permuted(remainderOf(cell.x())) + remainderOf(cell.y())) + remainderOf(cell.z()));
}
double fraction(double x) { return x - std::floor(x); }
/// Each -1..1.
Vec3 vectorOf(double hash) {
  return Vec3(2.0 * fraction(0.618034 * hash) - 1.0, 2.0 * fraction(0.754878 * hash) - 1.0,
              2.0 * fraction(0.569840 * hash) - 1.0);
}

double smoothStep(double from, double to, double x) {
  const double s = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}
double mixed(double a, double b, double share) { return a + share * (b - a); }
double fade(double x) { return x * x * x * (x * (6.0 * x - 15.0) + 10.0); }

// Perlin's gradient noise, about -1..1, with cells of one.
double gradientNoise(const Vec3& p) {
  const Vec3 cell = p.array().floor().matrix(), in = p - cell;
  double along[2][2][2];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 2; ++k) {
        const Vec3 corner(i, j, k);
        along[i][j][k] = vectorOf(hashOf(cell + corner)).dot(in - corner);
      }
  const double x = fade(in.x()), y = fade(in.y()), z = fade(in.z());
  const auto edge = [&](int j, int k) { return mixed(along[0][j][k], along[1][j][k], x); };
  return mixed(mixed(edge(0, 0), edge(1, 0), y), mixed(edge(0, 1), edge(1, 1), y), z);
}

// Worley's cells: how much farther the second nearest seed is than the nearest, which is 0 on the walls between cells;
// and a share 0..1 of the nearest one's cell. Seeds stay near the middles of their cells: the eight around a place do.
struct Cells {
  double beyond_wall = 0.0, tint = 0.0;
};
Cells cellsAt(const Vec3& p) {
  const Vec3 first = (p.array() - 0.5).floor().matrix();
  double nearest = 1e9, second = 1e9;
  Cells cells;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 2; ++k) {
        const Vec3 cell = first + Vec3(i, j, k);
        const double hash = hashOf(cell);
        const double distance = (cell + Vec3::Constant(0.5) + kJitter * vectorOf(hash) - p).norm();
        if (distance < nearest) {
          second = nearest;
          nearest = distance;
          cells.tint = hash / kPeriod;
        } else {
          second = std::min(second, distance);
        }
      }
  cells.beyond_wall = second - nearest;
  return cells;
}

Status outOfRange(const std::string& key, double value, const char* accepted) {
  std::ostringstream text;
  text << key << " is " << value << "; accepted: " << accepted;
  return Error{ErrorCode::kInvalidArgument, text.str()};
}

auto channels(const Color& c) { return std::tie(c.r, c.g, c.b, c.a); }

bool sameImage(const ImagePtr& one, const ImagePtr& other) {
  return one == other || (one && other && one->id() == other->id());
}

// Triplanar mapping: the image along each axis, the more of it the more the surface is turned there.
Color imageAt(const Image& image, const Vec3& p, const Vec3& normal) {
  Vec3 shares = normal.cwiseAbs2().cwiseAbs2();
  shares = shares.sum() > 0.0 ? Vec3(shares / shares.sum()) : Vec3(Vec3::Constant(1.0 / 3.0));
  const Color along[] = {image.at(p.y(), p.z()), image.at(p.x(), p.z()), image.at(p.x(), p.y())};
  Color mixed{0.0f, 0.0f, 0.0f, 1.0f};
  for (int axis = 0; axis < 3; ++axis) {
    const auto share = static_cast<float>(shares[axis]);
    mixed.r += share * along[axis].r;
    mixed.g += share * along[axis].g;
    mixed.b += share * along[axis].b;
  }
  return mixed;
}

}  // namespace

const char* toString(Noise noise) {
  switch (noise) {
    case Noise::kPlain:
      return "plain";
    case Noise::kVeins:
      return "veins";
    case Noise::kLobules:
      return "lobules";
    case Noise::kFat:
      return "fat";
    case Noise::kFibres:
      return "fibres";
    case Noise::kBone:
      return "bone";
    case Noise::kImage:
      return "image";
  }
  return "unknown";
}

Status Look::validate(const std::string& of) const {
  if (!(scale >= 1e-5 && scale <= 1.0)) return outOfRange(of + ".scale", scale, "1e-5 to 1 m");
  if (!(wetness >= 0.0 && wetness <= 1.0)) return outOfRange(of + ".wetness", wetness, "0 to 1");
  if (!(bump >= 0.0 && bump <= 1.0)) return outOfRange(of + ".bump", bump, "0 to 1");
  for (const float channel : {second.r, second.g, second.b, second.a})
    if (!(channel >= 0.0f && channel <= 1.0f)) return outOfRange(of + ".second", channel, "0 to 1");
  if ((noise == Noise::kImage) != (image != nullptr))
    return Error{ErrorCode::kInvalidArgument, of + (image ? " has an image and a noise" : " has no image")};
  return Done{};
}

bool operator==(const Look& one, const Look& other) {
  return channels(one.second) == channels(other.second) && one.noise == other.noise &&
         sameImage(one.image, other.image) && one.scale == other.scale && one.wetness == other.wetness &&
         one.bump == other.bump;
}
bool operator==(const Appearance& one, const Appearance& other) {
  return one.outer == other.outer && one.inner == other.inner;
}

double patternAt(const Look& look, const Vec3& place) {
  const Vec3 p = place / look.scale;
  switch (look.noise) {
    case Noise::kPlain:
    case Noise::kImage:
      return 0.0;
    case Noise::kVeins:
      return (1.0 - smoothStep(0.02, 0.10, std::abs(gradientNoise(p)))) *
             smoothStep(-0.15, 0.25, gradientNoise(0.37 * p + Vec3::Constant(7.3)));
    case Noise::kLobules: {
      const Cells cells = cellsAt(p);
      const double ground = 0.25 * cells.tint + 0.5 * std::clamp(0.45 + gradientNoise(0.13 * p), 0.0, 1.0);
      return mixed(ground, 1.0, 1.0 - smoothStep(0.0, 0.35, cells.beyond_wall));
    }
    case Noise::kFat: {
      const Cells cells = cellsAt(p);
      return mixed(0.3 * cells.tint, 1.0, 1.0 - smoothStep(0.0, 0.14, cells.beyond_wall));
    }
    case Noise::kFibres: {
      const Vec3 strand(0.08 * p.x(), p.y(), p.z());
      return std::clamp(0.5 + 0.8 * gradientNoise(strand) + 0.5 * gradientNoise(2.3 * strand), 0.0, 1.0);
    }
    case Noise::kBone:
      return std::clamp(0.3 + 0.6 * gradientNoise(0.25 * p), 0.0, 0.5) + 0.5 * smoothStep(0.2, 0.4, gradientNoise(p));
  }
  return 0.0;
}

Color colorAt(const Look& look, const Color& base, const Vec3& place, const Vec3& normal) {
  if (look.noise == Noise::kPlain) return base;
  if (look.noise == Noise::kImage) {
    Color color = imageAt(*look.image, place / look.scale, normal);
    color.a = base.a;
    return color;
  }
  const auto share = static_cast<float>(patternAt(look, place));
  const auto between = [share](float a, float b) {
    return std::clamp(a + share * (b - a), std::min(a, b), std::max(a, b));
  };
  return {between(base.r, look.second.r), between(base.g, look.second.g), between(base.b, look.second.b), base.a};
}

Color colorAt(const Look& look, const Color& base, const std::array<float, 2>& at) {
  const Image& image = *look.image;
  Color color = image.at(at[0], static_cast<double>(at[1]) * image.height() / image.width());
  color.a = base.a;
  return color;
}

}  // namespace meshless
