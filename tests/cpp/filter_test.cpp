#include "exactarm/ocp/filter.hpp"

#include <gtest/gtest.h>

namespace exactarm::ocp {
namespace {

TEST(Filter, AcceptsWhatIsBetterInOneOfTheTwo) {
  Filter filter(2);
  EXPECT_TRUE(filter.accepts({1e9, 1e9}));
  filter.add({10.0, 1.0});
  EXPECT_TRUE(filter.accepts({20.0, 0.9}));
  EXPECT_TRUE(filter.accepts({9.0, 5.0}));
  EXPECT_FALSE(filter.accepts({11.0, 1.1}));
  filter.add({5.0, 2.0});
  EXPECT_FALSE(filter.accepts({9.0, 5.0}));
}

TEST(Filter, AsksForAMarginSoThatItCannotCrawl) {
  Filter filter(1);
  filter.add({10.0, 1.0});
  EXPECT_FALSE(filter.accepts({10.0, 1.0}));
  EXPECT_FALSE(filter.accepts({10.0 - 0.5 * Filter::kMargin, 1.0 - 0.5 * Filter::kMargin}));
  EXPECT_TRUE(filter.accepts({10.0, 1.0 - 2.0 * Filter::kMargin}));
}

}  // namespace
}  // namespace exactarm::ocp
