#include "meshless_surgery/geometry/mesh/even_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <sstream>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using SharpEdges = Mesh::Property_map<Mesh::Edge_index, bool>;
using KeptVertices = Mesh::Property_map<Mesh::Vertex_index, bool>;

constexpr double kSharp = 40.0;        // [degrees] between normals of faces: an edge is kept
constexpr double kCornerCosine = 0.5;  // a vertex where sharp edges turn by more than 60 degrees is kept
constexpr unsigned kIterations = 3;
constexpr double kBulge = 0.75;        // of what a sphere has over the centre of a face, over all of the face
constexpr double kMostDistance = 0.2;  // of the edge
constexpr double kMostVolume = 0.05;   // by which the volume may be off

Error unsuitable(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

Vec3 placeOf(const Mesh& mesh, Mesh::Vertex_index v) {
  const auto& p = mesh.point(v);
  return {p.x(), p.y(), p.z()};
}

std::array<Mesh::Vertex_index, 3> cornersOf(const Mesh& mesh, Mesh::Face_index f) {
  const auto h = mesh.halfedge(f);
  return {mesh.source(h), mesh.target(h), mesh.target(mesh.next(h))};
}

// Where sharp edges meet, end or turn.
void keepCorners(const Mesh& mesh, const SharpEdges& sharp, KeptVertices& kept) {
  for (const auto v : mesh.vertices()) {
    int count = 0;
    std::array<Vec3, 2> ways;
    for (const auto h : CGAL::halfedges_around_target(v, mesh)) {
      if (!sharp[mesh.edge(h)] && !mesh.is_border(mesh.edge(h))) continue;
      if (count < 2) ways[count] = (placeOf(mesh, mesh.source(h)) - placeOf(mesh, v)).normalized();
      ++count;
    }
    kept[v] = count == 1 || count > 2 || (count == 2 && ways[0].dot(ways[1]) > -kCornerCosine);
  }
}

// Vertices lie on the given surface, and so faces lie below it where it bulges: moved out, so that nothing is lost.
void evenOut(const SolidQuery& given, const SharpEdges& sharp, const KeptVertices& kept, Mesh& mesh) {
  const std::size_t count = mesh.num_vertices() + mesh.number_of_removed_vertices();
  Points ways(count, Vec3::Zero()), normals(count, Vec3::Zero());
  std::vector<int> faces(count, 0);
  for (const auto f : mesh.faces()) {
    const auto corners = cornersOf(mesh, f);
    const Vec3 a = placeOf(mesh, corners[0]), b = placeOf(mesh, corners[1]), c = placeOf(mesh, corners[2]);
    const Vec3 centre = (a + b + c) / 3.0, way = given.nearest(centre) - centre, normal = (b - a).cross(c - a);
    for (const auto v : corners) {
      ways[v] += way;
      normals[v] += normal;
      ++faces[v];
    }
  }
  for (const auto e : mesh.edges())
    if (sharp[e] || mesh.is_border(e)) faces[mesh.vertex(e, 0)] = faces[mesh.vertex(e, 1)] = 0;
  for (const auto v : mesh.vertices()) {
    if (faces[v] == 0 || kept[v]) continue;
    const Vec3 normal = normals[v].normalized();
    const Vec3 p = placeOf(mesh, v) + kBulge * normal.dot(ways[v]) / faces[v] * normal;
    mesh.point(v) = Kernel::Point_3(p.x(), p.y(), p.z());
  }
}

TriangleMesh withoutGaps(const Mesh& mesh) {
  TriangleMesh plain;
  std::vector<Index> numbers(mesh.num_vertices() + mesh.number_of_removed_vertices(), kNoIndex);
  for (const auto f : mesh.faces()) {
    Triangle t;
    int k = 0;
    for (const auto v : cornersOf(mesh, f)) {
      Index& number = numbers[v];
      if (number == kNoIndex) {
        number = static_cast<Index>(plain.vertices.size());
        plain.vertices.push_back(placeOf(mesh, v));
      }
      t[k++] = number;
    }
    plain.triangles.push_back(t);
  }
  return plain;
}

double farthest(const TriangleMesh& from, const SolidQuery& to) {
  double most = 0.0;
  for (const Vec3& v : from.vertices) most = std::max(most, to.distance(v));
  for (const Triangle& t : from.triangles)
    most = std::max(most, to.distance((from.vertices[t[0]] + from.vertices[t[1]] + from.vertices[t[2]]) / 3.0));
  return most;
}

// Of the surface about the origin.
Result<EvenSurface> remeshed(const TriangleMesh& surface, const SolidQuery& given, double edge) {
  Mesh mesh;
  for (const Vec3& v : surface.vertices) mesh.add_vertex(Kernel::Point_3(v.x(), v.y(), v.z()));
  for (const Triangle& t : surface.triangles)
    if (mesh.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]), Mesh::Vertex_index(t[2])) ==
        Mesh::null_face())
      return unsuitable("it is no oriented surface: an edge has more than two faces, or two of one direction");
  SharpEdges sharp = mesh.add_property_map<Mesh::Edge_index, bool>("e:sharp", false).first;
  KeptVertices kept = mesh.add_property_map<Mesh::Vertex_index, bool>("v:kept", false).first;
  try {
    CGAL::Polygon_mesh_processing::detect_sharp_edges(mesh, kSharp, sharp);
    keepCorners(mesh, sharp, kept);
    CGAL::Polygon_mesh_processing::isotropic_remeshing(
        mesh.faces(), edge, mesh,
        CGAL::parameters::edge_is_constrained_map(sharp).vertex_is_constrained_map(kept).number_of_iterations(
            kIterations));
  } catch (const std::exception& fault) {  // CGAL's assertions, where they are switched on
    return unsuitable(std::string("it cannot be remeshed: ") + fault.what());
  }
  evenOut(given, sharp, kept, mesh);
  EvenSurface even;
  even.mesh = withoutGaps(mesh);
  if (even.mesh.triangles.empty()) return unsuitable("nothing is left of it");
  even.distance = std::max(farthest(even.mesh, given), farthest(surface, SolidQuery(even.mesh)));
  return even;
}

Status checkSame(const TriangleMesh& surface, const TriangleMesh& even) {
  const MeshReport before = inspectMesh(surface, false), after = inspectMesh(even);
  std::ostringstream why;
  if (before.components != after.components)
    why << "it has " << after.components << " parts in place of " << before.components;
  else if (before.closed() && !after.closed())
    why << "it is not closed any more";
  else if (after.degenerate_triangles > 0)
    why << after.degenerate_triangles << " of its triangles have no area";
  else if (before.closed() &&
           !(std::abs(after.signed_volume - before.signed_volume) <= kMostVolume * std::abs(before.signed_volume)))
    why << "its volume is " << after.signed_volume << " m^3 in place of " << before.signed_volume;
  else if (after.self_intersections > 0 && inspectMesh(surface).self_intersections == 0)
    why << "it crosses itself";
  else
    return Done{};
  return unsuitable(why.str());
}

}  // namespace

Result<EvenSurface> evenSurface(const TriangleMesh& surface, double edge, std::size_t most_triangles) {
  const MeshReport report = inspectMesh(surface, false);
  if (surface.triangles.empty() || report.non_finite_vertices > 0 || report.bad_indices > 0)
    return unsuitable("it has no triangles, or some with corners that are not there or not finite");
  const double area = surfaceArea(surface), least = std::sqrt(area / (0.25 * std::sqrt(3.0) * most_triangles));
  if (!(edge > 0.0) || !std::isfinite(edge) || edge < least) {
    std::ostringstream text;
    text << "an edge of " << edge << " m of even triangles; accepted: above 0, finite, and at least " << least
         << " m, which makes " << most_triangles << " triangles";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  if (report.degenerate_triangles > 0)
    return unsuitable(std::to_string(report.degenerate_triangles) + " of its triangles have no area");
  const Box bounds = boundsOf(surface.vertices);
  const Vec3 middle = 0.5 * (bounds.min + bounds.max);
  TriangleMesh centred = surface;
  for (Vec3& v : centred.vertices) v -= middle;
  const SolidQuery given(centred);
  Error why;
  for (const double tried : {edge, 0.5 * edge}) {
    if (tried < least) break;
    Result<EvenSurface> even = remeshed(centred, given, tried);
    if (!even) return even.error();
    if (const Status same = checkSame(centred, even->mesh); !same) {
      why = same.error();
    } else if (!(even->distance <= kMostDistance * edge)) {
      std::ostringstream text;
      text << "it is " << even->distance << " m from where it was; accepted: up to " << kMostDistance * edge << " m";
      why = unsuitable(text.str());
    } else {
      for (Vec3& v : even->mesh.vertices) v += middle;
      return even;
    }
  }
  std::ostringstream text;
  text << "remeshed to edges of " << edge << " m, " << why.detail;
  return unsuitable(text.str());
}

}  // namespace meshless
