// Nobody starts wholly inside another: contact knows no way out of there.
#include <algorithm>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "world_impl.h"

namespace meshless {
namespace {

struct Solid {
  std::string name;
  const Points& vertices;
  const std::vector<Triangle>& triangles;
  Box bounds;
};

bool holds(const Box& outer, const Box& inner) { return outer.contains(inner.min) && outer.contains(inner.max); }

bool isInside(const Solid& inner, const Solid& outer) {
  if (!holds(outer.bounds, inner.bounds)) return false;
  TriangleMesh surface;
  surface.vertices = outer.vertices;
  surface.triangles = outer.triangles;
  const SolidQuery solid(surface);
  return std::all_of(inner.vertices.begin(), inner.vertices.end(), [&](const Vec3& p) { return solid.contains(p); });
}

Status areApart(const Solid& one, const Solid& other) {
  const bool inside = isInside(one, other);
  if (!inside && !isInside(other, one)) return Done{};
  return Error{ErrorCode::kInvalidArgument, (inside ? one.name + " lies wholly inside " + other.name
                                                    : other.name + " lies wholly inside " + one.name) +
                                                "; accepted: outside of each other, or in a cavity"};
}

Solid solidOf(const WorldBody& body) {
  return {"body '" + body.name + "'", body.state.surface, body.model->surface.triangles, body.bounds};
}

Solid solidOf(const WorldObstacle& obstacle) {
  const TriangleMesh& mesh = obstacle.def->mesh;
  return {"obstacle '" + obstacle.def->name + "'", mesh.vertices, mesh.triangles, obstacle.bounds};
}

}  // namespace

// The first refusal of a solid body whose box holds this one, or lies in it.
template <class Check>
Status World::Impl::eachAround(const Box& box, const std::vector<BodyId>& but, const Check& check) {
  for (const auto& body : bodies) {
    if (std::find(but.begin(), but.end(), body->id) != but.end()) continue;
    if (!body->model->solid || !(holds(body->bounds, box) || holds(box, body->bounds))) continue;
    refreshSurface(*body);
    if (Status status = check(*body); !status) return status;
  }
  return Done{};
}

Status World::Impl::liesApart(const PreparedBody& body, const std::vector<BodyId>& but) {
  if (Status apart = liesApart(body.state.surface, *body.model, body.def.name); !apart) return apart;
  if (settings.contact == ContactMethod::kNone || !body.model->solid) return Done{};
  const Solid one{"body '" + body.def.name + "'", body.state.surface, body.model->surface.triangles,
                  boundsOf(body.state.surface)};
  if (settings.contact == ContactMethod::kSurface)
    for (const auto& obstacle : obstacles)
      if (Status apart = areApart(one, solidOf(*obstacle)); !apart) return apart;
  return eachAround(one.bounds, but, [&](const WorldBody& other) { return areApart(one, solidOf(other)); });
}

Status World::Impl::liesApart(const WorldObstacle& obstacle) {
  if (settings.contact != ContactMethod::kSurface) return Done{};
  const Solid one = solidOf(obstacle);
  return eachAround(one.bounds, {}, [&](const WorldBody& other) { return areApart(one, solidOf(other)); });
}

}  // namespace meshless
