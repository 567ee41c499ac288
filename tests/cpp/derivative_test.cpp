#include "exactarm/base/derivative.hpp"

#include <gtest/gtest.h>

#include "exactarm/base/check.hpp"
#include "exactarm/base/types.hpp"

namespace exactarm {
namespace {

TEST(Derivative, IsOfEighthOrderInsideABlock) {
  const long count = 41;
  double worst[2];
  for (int half = 0; half < 2; ++half) {
    const double step = half ? 0.05 : 0.1;
    Vector time(count), wave(count), slope(count);
    for (long k = 0; k < count; ++k) time[k] = 3.0 + step * k, wave[k] = std::sin(2.0 * time[k]);
    derivative(wave.data(), time.data(), count, 1, {0}, slope.data());
    worst[half] = std::abs(slope[20] - 2.0 * std::cos(2.0 * time[20])) +
                  std::abs(slope[12] - 2.0 * std::cos(2.0 * time[12]));
  }
  EXPECT_GT(worst[0] / worst[1], 150.0);  // 2^8 but for where on the wave
}

// Lines are exact everywhere, in blocks of 1 to 9 rows too.
TEST(Derivative, BlocksDoNotSeeEachOther) {
  std::vector<long> starts;
  long rows = 0;
  for (long size = 1; size <= 9; ++size) starts.push_back(rows), rows += size;
  Vector time(rows);
  RowMatrix values(rows, 2), slope(rows, 2);
  for (long b = 0, k = 0; b < 9; ++b)
    for (long i = 0; i <= b; ++i, ++k)
      time[k] = 100.0 * b + 0.5 * i, values.row(k) << 3.0 * b + (b + 1.0) * time[k], -b;
  derivative(values.data(), time.data(), rows, 2, starts, slope.data());
  for (long b = 0, k = 0; b < 9; ++b)
    for (long i = 0; i <= b; ++i, ++k) {
      EXPECT_NEAR(slope(k, 0), b ? b + 1.0 : 0.0, 1e-9);  // a single sample has no rate
      EXPECT_NEAR(slope(k, 1), 0.0, 1e-12);
    }
}

TEST(Derivative, BlocksThatDoNotCoverTheSamplesAreRefused) {
  const Vector time = Vector::LinSpaced(10, 0.0, 1.0);
  Vector out(10);
  EXPECT_THROW(derivative(time.data(), time.data(), 10, 1, {}, out.data()), InvalidArgument);
  EXPECT_THROW(derivative(time.data(), time.data(), 10, 1, {3}, out.data()), InvalidArgument);
  EXPECT_THROW(derivative(time.data(), time.data(), 10, 1, {0, 12}, out.data()), InvalidArgument);
}

}  // namespace
}  // namespace exactarm
