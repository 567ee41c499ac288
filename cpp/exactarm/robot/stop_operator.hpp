// Stop operator, the memory of hysteresis (Visintin 1994): z follows the motion and is held within +-reach.
//   z_0 = 0, z_k = clip(z_{k-1} + motion_k - motion_{k-1}, -reach, reach)
// Output z / reach and its derivative by the reach, one number a sample of one run.
#pragma once

namespace exactarm {

void stop_operator(const double* motion, long count, double reach, double* memory, double* by_reach);

}  // namespace exactarm
