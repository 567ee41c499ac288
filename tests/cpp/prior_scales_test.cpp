#include "exactarm/base/prior_scales.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "random_states.hpp"

namespace exactarm {
namespace {

const Vector kSquares = (Vector(3) << 0.01, 1.0, 1e4).finished();

TEST(PriorScales, AgreeWithTheEigenvalues) {
  const long blocks = 4;
  testing::Random random(92);
  for (long k : {1, 2, 3, 7, 20}) {
    RowMatrix gram(blocks * k, k), y = random.matrix(blocks, k), gains(3, blocks), prices(3, blocks);
    for (long b = 0; b < blocks; ++b) {
      const RowMatrix columns = random.matrix(k + b, k);
      gram.middleRows(b * k, k) = columns.transpose() * columns;
    }
    gains_by_scale(gram.data(), y.data(), blocks, k, kSquares.data(), 3, gains.data(), prices.data());
    for (long b = 0; b < blocks; ++b) {
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> own(gram.middleRows(b * k, k));
      const Vector turned = own.eigenvectors().transpose() * y.row(b).transpose();
      for (long s = 0; s < 3; ++s) {
        const Eigen::ArrayXd pivots = 1.0 + kSquares[s] * own.eigenvalues().array();
        const double gain = kSquares[s] * (turned.array().square() / pivots).sum();
        EXPECT_NEAR(gains(s, b), gain, 1e-9 * gain);
        EXPECT_NEAR(prices(s, b), 0.5 * pivots.log().sum(), 1e-9);
      }
    }
  }
}

// Of a block that others explain only rounding is left, of either sign: it costs nothing and gains nothing.
TEST(PriorScales, RoundingBelowZeroIsNothing) {
  const double gram[4] = {-1e-3, 2e-4, 2e-4, -1e-3}, y[2] = {0.0, 0.0};
  double gains[3], prices[3];
  gains_by_scale(gram, y, 1, 2, kSquares.data(), 3, gains, prices);
  for (long s = 0; s < 3; ++s) {
    EXPECT_EQ(gains[s], 0.0);
    EXPECT_EQ(prices[s], 0.0);
  }
}

TEST(PriorScales, ManyLargePivotsDoNotOverflow) {
  const long k = 40;
  const RowMatrix gram = 1e30 * RowMatrix::Identity(k, k);
  const Vector y = Vector::Ones(k);
  double gain, price;
  gains_by_scale(gram.data(), y.data(), 1, k, kSquares.data() + 1, 1, &gain, &price);
  EXPECT_NEAR(price, 0.5 * k * std::log(1e30), 1e-9 * price);
  EXPECT_NEAR(gain, k * 1e-30, 1e-12 * gain);
}

}  // namespace
}  // namespace exactarm
