// What a user chose of a body, before anything is built from it.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/dynamics/clusters.h"
#include "meshless_surgery/dynamics/material.h"
#include "meshless_surgery/geometry/query/region.h"
#include "meshless_surgery/geometry/mesh/texture_map.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Tissue in there is held in place.
struct HeldRegion {
  Region region;
  bool in_world = true;  // else it is in the body's own frame, and goes where the body is placed
  std::string follows;   // name of a frame of the caller's, as which what is held moves from then on; empty: none

  HeldRegion() = default;
  HeldRegion(const Box& box) : region(box) {}
  HeldRegion(const Vec3& min, const Vec3& max) : region(min, max) {}
  HeldRegion(const Region& there, bool world) : region(there), in_world(world) {}
};

/// Tissue in there, in the body's own frame, is of another material: its elastic constants, density and inside_color
/// count. Needs an elastic body of filled cells.
struct TissueRegion {
  Region region;
  Material material;
};

/// What contact takes for the surface of a body of cells: a surface of even triangles where the visual one is
/// finer than that (kAuto), the visual one, or even triangles of an edge [m]. Other bodies have the visual one.
struct CollisionChoice {
  enum class Kind { kAuto, kVisual, kEdge };
  Kind kind = Kind::kAuto;
  double edge = 0.0;
};

/// What fills the cavities of a body.
struct CavityFill {
  enum class Kind { kEmpty, kPressure, kVolume };
  Kind kind = Kind::kEmpty;
  double pressure = 0.0;  // [Pa] 0..1e6, more than around the body: held
  /// [m^3] above 0 to 1e3, of what fills all of them together, each by its share of their volume, where it is under no
  /// pressure; 0: as much as they hold at rest.
  double volume = 0.0;
  double compliance = 0.0;  // [m^3/Pa] above 0 to 1, of each; 0: kCavityCompliance of its volume at rest
  double leak = 1.0;        // [s] above 0 to 3600 in which the pressure falls to 0 once a cavity is open

  bool empty() const { return kind == Kind::kEmpty; }
  Status validate() const;
};
/// [1/Pa] Much more than water's, little enough that a thousand Pa take a thousandth of the volume.
constexpr double kCavityCompliance = 1e-6;

/// How finely a body is divided where no spacing is given: medium keeps an elastic body to a twentieth of one thread's
/// time, the others are 1.5 times as coarse or as fine.
enum class Resolution { kCoarse, kMedium, kFine };

struct BodyDef {
  std::string name;
  TriangleMesh mesh;      // in the body's own frame, already scaled [m]; repaired (geometry/mesh/mesh_check.h)
  TextureMapPtr texture;  // of the mesh as it was read; null: its file has none
  bool solid = true;      // false: an open surface; no interior particles, no volume, cannot be cut
  double thickness = 0;   // [m] above 0: the mesh is the middle of a layer, or the outside of a wall; see thicken.h
  Pose pose;              // body's frame in the world
  double spacing = 0;     // [m] between interior particles; 0: chosen from shape, material and resolution
  Resolution resolution = Resolution::kMedium;
  ClusterOptions clusters;
  CollisionChoice collision;
  Material material;
  std::vector<HeldRegion> fixed;
  CavityFill cavities;
  /// By how much tissue is drawn out along the body's own axes, compared with its shape without stress: 0.25 to 4 each,
  /// of product 1. Needs a solid of an elastic material.
  Vec3 prestretch = Vec3::Ones();
  Vec3 fibre_direction = Vec3::Zero();  // of the material's fibres, in the body's own frame; zero: along the body
  std::vector<TissueRegion> regions;  // where several are, the last one counts; up to 100
  bool copy = false;                  // the same as the body before it in its scene, but for name and pose
  std::vector<std::string> notes;     // what reading and repairing said
  std::vector<std::string> warnings;  // likewise, of what is not as was asked
};

}  // namespace meshless
