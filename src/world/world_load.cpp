// What a body bears, for those who measure. It changes nothing.
#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/query/nearest.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kBeside = 2.0;  // spacings from the middle of a cell that a place in its tissue may be

}  // namespace

Result<BodyLoad> World::load(const std::string& name, const Points& points) {
  const WorldBody* const body = impl_->find(name);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + name + "'; " + impl_->knownBodies()};
  const BodyModel& model = *body->model;
  if (!body->material.elastic())
    return Error{ErrorCode::kUnsupported, "'" + name + "' is of the appearance material '" + body->material.name +
                                              "', which goals draw and no stress; accepted: elastic materials"};
  if (!model.cells)
    return Error{ErrorCode::kUnsuitableShape,
                 "'" + name +
                     "' has no inside, and so no cells that bear stress; accepted: closed surfaces, or "
                     "open ones with thickness"};
  for (std::size_t k = 0; k < points.size(); ++k)
    if (!points[k].allFinite()) return notFinite("points[" + std::to_string(k) + "]");
  BodyLoad load = loadOf(model, body->material, body->state);
  if (points.empty()) return load;
  Points middles;
  for (const CellLoad& cell : load.cells) middles.push_back(cell.place);
  const NearestPoints nearest(std::move(middles));
  std::vector<CellLoad> found;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const CellLoad& cell = load.cells[nearest.nearest(points[k])];
    const double way = (cell.place - points[k]).norm();
    if (!(way <= kBeside * model.spacing))
      return Error{ErrorCode::kMissed, "points[" + std::to_string(k) + "] is " + numberText(way, 3) + " m from '" +
                                           name + "'; accepted: up to " + numberText(kBeside * model.spacing, 3) +
                                           " m from the middle of a cell"};
    found.push_back(cell);
  }
  load.cells = std::move(found);
  return load;
}

}  // namespace meshless
