// Run time of a complete substep (predict, match, restore momentum, gravity) of bodies in free fall: the vectorised
// batches, beside the plain double path in the same process (reference/...) and Bullet's soft bodies (bullet/pose: pose
// matching without links). One substep an iteration, but in liver rows one frame; of the repetitions, the median
// counts. `error` is the largest distance of a particle from where the plain path puts it in one substep from the same
// state, relative to the body's width; `same` is 1 where two threads give what one gives, to the bit.
#include "step_rows.h"

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::bench::registerPile();
  meshless::bench::registerCells();
  meshless::bench::registerLiver();
  meshless::bench::registerWorld();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
