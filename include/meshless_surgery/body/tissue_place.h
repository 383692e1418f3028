// A place in the tissue of a body of cells, which goes where that tissue goes.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

struct TissuePlace {
  Index cell = kNoIndex;   // no bridge; kNoIndex: nowhere
  Vec3 at = Vec3::Zero();  // in it, each coordinate 0..1 inside
};

}  // namespace meshless
