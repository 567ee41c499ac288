#include "exactarm/base/prior_scales.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/base/types.hpp"

namespace exactarm {
namespace {

constexpr double kWorkBetweenChecks = 1e7;  // for a signal: multiplications
constexpr double kMostProduct = 1e150;      // of pivots, before its logarithm is taken

}  // namespace

void gains_by_scale(const double* gram, const double* y, long blocks, long k, const double* squares,
                    long scales, double* gains, double* prices) {
  Eigen::Tridiagonalization<Matrix> turned(std::max(k, 2L));
  Matrix block(k, k);
  Vector diagonal(k), next(k), onto(k);
  double work = 0.0;
  for (long g = 0; g < blocks; ++g) {
    if (work > kWorkBetweenChecks) check_interrupt(), work = 0.0;
    work += 1.0 + 2.0 * k * k * k;
    block = Eigen::Map<const Matrix>(gram + g * k * k, k, k);
    onto = Eigen::Map<const Vector>(y + g * k, k);
    if (k > 1) {
      turned.compute(block);
      onto.applyOnTheLeft(turned.matrixQ().adjoint());
      diagonal = turned.diagonal();
      next.head(k - 1) = turned.subDiagonal();
    } else {
      diagonal = block.diagonal();
    }
    for (long s = 0; s < scales; ++s) {
      double gain = 0.0, price = 0.0, product = 1.0, before = 1.0, left = 0.0;
      for (long i = 0; i < k; ++i) {
        const double beside = i ? squares[s] * next[i - 1] : 0.0, factor = beside / before;
        const double pivot = std::max(1.0 + squares[s] * diagonal[i] - factor * beside, 1.0);
        left = onto[i] - factor * left;
        gain += left * left / pivot;
        product *= pivot;
        if (product > kMostProduct) price += std::log(product), product = 1.0;
        before = pivot;
      }
      gains[s * blocks + g] = squares[s] * gain;
      prices[s * blocks + g] = 0.5 * (price + std::log(product));
    }
  }
}

}  // namespace exactarm
