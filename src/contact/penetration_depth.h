// Consistent penetration depth and direction (Heidelberger et al. 2004).
#pragma once

#include "meshless_surgery/contact/textbook.h"

namespace meshless {

/// Fills depth and direction of all penetrations of one body into another: `first` .. `last` of a list in which they
/// stand together, ordered by particle. A penetration for which no direction can be found keeps depth 0 and a zero
/// direction.
///
/// - Edges of a with one end inside b leave b's boundary at a point with a normal. (Exactly: the face's own normal,
/// where
///   the paper interpolates the vertices'; and the exit nearest to the inner end.) A particle with such edges takes the
///   mean of their depths and normals, weighted with 1 / distance^2.
/// - The others take the mean over their neighbours that are done, layer by layer.
/// - Where no edge of a connected group leaves b (one body within another, or a body without edges), the group's
///   particle nearest to a boundary face of b starts the layers: the whole group then leaves the same way.
void computePenetrationDepths(const std::vector<ContactBody>& bodies, Penetration* first, Penetration* last);

}  // namespace meshless
