#include "meshless_surgery/training/followed_places.h"

#include <limits>

#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/training/frame.h"

namespace meshless {
namespace {

// Of the spacing. To the side: so far off, the nearest sample of a cell is one of that side.
constexpr double kAside = 0.25, kFarthest = 0.5;

}  // namespace

Points FollowedPlaces::now(const WorldSnapshot& shot) {
  std::vector<const BodySnapshot*> bodies;
  for (const BodySnapshot& body : shot.bodies)
    if (isOf(body.name, body_)) bodies.push_back(&body);
  bool same = bodies.size() == pieces_.size();
  for (std::size_t k = 0; k < bodies.size() && same; ++k)
    same = pieces_[k].number == bodies[k]->number && pieces_[k].model == bodies[k]->model;
  if (!same) bind(bodies);
  Points places(rest_.size(), Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const Piece& piece = pieces_[k];
    const Points& particles = bodies[k]->particles;
    for (Index n = 0; n < piece.which.size(); ++n) places[piece.which[n]] = piece.binding.place(n, particles);
  }
  return places;
}

// Each place goes to the piece that has its tissue, or is nearest to it.
void FollowedPlaces::bind(const std::vector<const BodySnapshot*>& bodies) {
  pieces_.clear();
  std::vector<double> away(rest_.size(), std::numeric_limits<double>::infinity());
  std::vector<std::size_t> owner(rest_.size(), bodies.size());
  const auto aside = [&](const BodySnapshot& body, Index n) {
    return body.placed.rotation.conjugate() *
           (rest_[n] + kAside * body.model->spacing * side_ - body.placed.translation);
  };
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const SolidQuery solid(bodies[k]->model->surface);
    for (Index n = 0; n < rest_.size(); ++n) {
      const Vec3 p = aside(*bodies[k], n);
      const double distance = solid.contains(p) ? 0.0 : solid.distance(p);
      if (!(distance < away[n]) || distance > kFarthest * bodies[k]->model->spacing) continue;
      away[n] = distance;
      owner[n] = k;
    }
  }
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const BodyModel& model = *bodies[k]->model;
    Piece piece{bodies[k]->number, bodies[k]->model, {}, {}};
    if (!model.lattice) {  // nothing lies in what has no inside
      pieces_.push_back(std::move(piece));
      continue;
    }
    const CellFinder finder(*model.lattice);
    Points local;
    std::vector<Index> cells;
    for (Index n = 0; n < rest_.size(); ++n) {
      if (owner[n] != k) continue;
      const Index cell = finder.nearest(aside(*bodies[k], n));
      if (cell == kNoIndex) continue;
      cells.push_back(cell);
      local.push_back(bodies[k]->placed.rotation.conjugate() * (rest_[n] - bodies[k]->placed.translation));
      piece.which.push_back(n);
    }
    if (!local.empty()) piece.binding = bindToCells(*model.lattice, local, cells);
    pieces_.push_back(std::move(piece));
  }
}

}  // namespace meshless
