// Bodies made of the parts of another: models and states of the pieces that a blade left.
#pragma once

#include <functional>
#include <optional>

#include "meshless_surgery/body/cut_body.h"
#include "rest_places.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {

struct PieceSource {
  const TriangleMesh& mesh;      // present shape; patches filled
  const VertexOrigins& origins;  // of its vertices
  std::vector<Index> members;    // the parent's particles, ascending; may be empty: a crumb
  /// True where a wound face lies between the piece's vertex and the parent's particle: it must not follow it. May be
  /// empty.
  std::function<bool(Index vertex, Index particle)> separated = nullptr;
};

class PieceMaker {
 public:
  /// new_patch: of the faces that the blade made.
  PieceMaker(const BodyModel& model, const BodyState& state, std::uint32_t new_patch);

  /// The parent's graph without the edges that the blade has cut; the clusters whose members it parts grow again.
  void tear(ParticleGraph graph, std::vector<bool> torn);

  /// Does beforehand what a cut by the plane, or an incision by the blade, is sure to need.
  void foresee(const Plane& plane);
  void foresee(const Blade& blade);

  /// All pieces of the parent: mass and momentum are shared out without a rest.
  std::vector<BodyPiece> make(const std::vector<PieceSource>& sources);

  const CutWork& work() const { return work_; }

 private:
  struct Crumb;
  /// What is known of a piece's vertices in the rest shape.
  struct RestShape {
    Points vertices;
    std::vector<Index> inside;  // of each: its number in places_, kNoIndex: not inside a cap
  };
  BodyPiece makeOne(const PieceSource& source, RestShape rest, const std::vector<double>& masses, const Crumb* crumb,
                    CutWork& work) const;
  std::vector<RestShape> restVertices(const std::vector<PieceSource>& sources);
  /// A particle of the piece that a vertex made by the blade may follow, near it; kNoIndex: not found at once.
  Index startOf(const PieceSource& source, Index vertex, Index inside, const std::vector<Index>& renumbered) const;

  const BodyModel& model_;
  const BodyState& state_;
  std::uint32_t new_patch_;
  ParticleGraph graph_;
  std::vector<bool> torn_;
  std::vector<Index> embedded_of_;
  std::optional<RestPlaces> rest_places_;
  FoundPlaces places_;
  CutWork work_;
};

}  // namespace meshless
