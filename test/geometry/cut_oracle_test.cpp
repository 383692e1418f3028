// Cuts against CGAL: its clip for volumes and cap areas, its search for faces that cross.
#include <random>

#include <gtest/gtest.h>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include "cut_rows.h"
#include "support/cut_cases.h"
#include "support/mesh_laws.h"
#include "support/plane_cut.h"

namespace meshless {
namespace cut_oracle_test {

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

constexpr std::uint32_t kCap = 7;

/// Empty where some edge has more than two faces or a vertex joins two fans.
Surface surfaceOf(const TriangleMesh& mesh) {
  Surface surface;
  std::vector<Surface::Vertex_index> made;
  for (const Vec3& p : mesh.vertices) made.push_back(surface.add_vertex(Kernel::Point_3(p.x(), p.y(), p.z())));
  for (const Triangle& t : mesh.triangles)
    if (surface.add_face(made[t[0]], made[t[1]], made[t[2]]) == Surface::null_face()) return Surface();
  return surface;
}

/// A plane askew through the shape's middle.
Plane askew(const TriangleMesh& mesh, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(-0.3, 0.3);
  const Box box = boundsOf(mesh.vertices);
  const Vec3 direction(normal(random), normal(random), normal(random));
  const Vec3 place(unit(random), unit(random), unit(random));
  return {direction.normalized(), 0.5 * (box.min + box.max) + (box.max - box.min).cwiseProduct(place)};
}

std::size_t crossingsIn(const CutSurface& cut) {
  std::size_t sum = 0;
  for (const CutPiece& piece : cut.pieces) {
    const Surface surface = surfaceOf(piece.mesh);
    std::vector<std::pair<Surface::Face_index, Surface::Face_index>> found;
    pmp::self_intersections(surface, std::back_inserter(found));
    sum += surface.number_of_faces() == 0 ? 1 : found.size();
  }
  return sum;
}

std::vector<shapes::Shape> embeddedShapes() {
  std::vector<shapes::Shape> all = shapes::allShapes();
  for (const shapes::Shape& shape : shapes::hardShapes()) all.push_back(shape);
  return all;
}

TEST(CutOracle, VolumesAndCapsAreThoseOfCgalsClip) {
  int compared = 0;
  for (const shapes::Shape& shape : embeddedShapes()) {
    SCOPED_TRACE(shape.name);
    std::mt19937 random(31);
    ASSERT_GT(surfaceOf(shape.mesh).number_of_faces(), 0u);
    bench::CgalClip clip(shape.mesh);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    for (int i = 0; i < 4; ++i) {
      const Plane plane = askew(shape.mesh, random);
      CutOptions options;
      options.cap_points = i % 2 ? kUsualCapPoints : 0;
      const Result<CutSurface> cut = cutByPlane(shape.mesh, plane, options);
      if (!cut) {
        EXPECT_EQ(cut.error().code, ErrorCode::kMissed);
        continue;
      }
      bool in_band = false;
      for (const Vec3& p : shape.mesh.vertices) in_band |= std::abs(plane.height(p)) <= 1.01 * options.band * size;
      // A vertex in the band is used where it is: the volume and the area differ by what lies between it and the plane.
      const double slack = in_band ? options.band * size : 0.0;
      ++compared;
      clip.copy();
      ASSERT_TRUE(clip.run(plane));
      for (const int side : {-1, 1}) {
        double volume = 0.0, area = 0.0;
        for (const CutPiece& piece : cut->pieces) {
          if (piece.side != side) continue;
          volume += signedVolume(piece.mesh);
          area += surfaceArea(piece.mesh);
        }
        const std::size_t k = side < 0 ? 0 : 1;
        EXPECT_NEAR(volume, clip.volumes()[k], 1e-9 * volume + slack * size * size) << "plane " << i;
        EXPECT_NEAR(area, clip.areas()[k], 1e-9 * area + slack * size) << "plane " << i;
      }
      double outside = 0.0;  // what of the surface is no cap
      for (const CutPiece& piece : cut->pieces) outside += surfaceArea(piece.mesh);
      EXPECT_NEAR(outside - 2.0 * cut->cap_area, surfaceArea(shape.mesh), 1e-9 * outside + slack * size);
    }
  }
  EXPECT_GE(compared, 60);
}

TEST(CutOracle, RoughPiecesAreClosedAndDoNotCrossThemselves) {
  int rough = 0, cuts = 0, clean = 0;
  for (const shapes::Shape& shape : embeddedShapes()) {
    SCOPED_TRACE(shape.name);
    std::mt19937 random(37);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    for (int i = 0; i < 12; ++i) {
      // Some planes graze, follow faces or pass just under them, so that the noise would leave the solid.
      const Plane plane = i % 2 ? shapes::hardPlane(shape.mesh, random) : askew(shape.mesh, random);
      CutOptions options;
      options.cap_patch = kCap;
      options.cap_points = 600;
      const Result<CutSurface> flat = cutByPlane(shape.mesh, plane, options);
      options.roughness = size * std::pow(10.0, -3.0 + 0.3 * i);  // up to twice the size
      options.seed = static_cast<std::uint32_t>(i);
      const Result<CutSurface> cut = cutByPlane(shape.mesh, plane, options);
      ASSERT_TRUE(laws::cutObeysLaws(shape.mesh, plane, options, cut)) << "plane " << i;
      ASSERT_EQ(cut.ok(), flat.ok());
      if (!cut) continue;
      ASSERT_EQ(cut->pieces.size(), flat->pieces.size());
      for (const CutPiece& piece : cut->pieces)
        for (const Index v : piece.cap_interior) rough += std::abs(plane.height(piece.mesh.vertices[v])) > 1e-6 * size;
      const std::size_t crossings = crossingsIn(*cut);
      // A flat cut along a face may touch that face, but for rounding.
      if (crossings > 0) {
        EXPECT_LE(crossings, crossingsIn(*flat)) << "plane " << i;
      }
      clean += crossings == 0;
      ++cuts;
    }
  }
  EXPECT_GE(clean, 0.9 * cuts);
  EXPECT_GT(rough, 10000);
  std::printf("%d rough vertices in %d cuts, %d of them without any faces that touch\n", rough, cuts, clean);
}

}  // namespace cut_oracle_test
}  // namespace meshless
