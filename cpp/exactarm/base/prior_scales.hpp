// What blocks of coefficients explain, for several sizes of their prior N(0, s^2) at once. With H = A'A
// (k, k) of the whitened columns and y = A'r (k) of the residual r:
//   gain = y' (I / s^2 + H)^-1 y        price = log det(I + s^2 H) / 2
// H is brought to three diagonals once, and each s costs O(k). The pivots of I + s^2 H are one
// at least: what lies below is rounding. The same bits wherever the memory lies.
#pragma once

namespace exactarm {

// gram (blocks, k, k) and y (blocks, k); squares (scales): s^2; gains, prices (scales, blocks).
void gains_by_scale(const double* gram, const double* y, long blocks, long k, const double* squares,
                    long scales, double* gains, double* prices);

}  // namespace exactarm
