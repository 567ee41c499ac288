#include "exactarm/base/parallel.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <numeric>
#include <stdexcept>

namespace exactarm {
namespace {

std::vector<int> visits(long rows, int threads, long least) {
  std::vector<int> count(static_cast<std::size_t>(rows), 0);
  parallel_rows(rows, threads, least, [&](long begin, long end) {
    EXPECT_EQ(begin % kRowsTogether, 0);
    for (long row = begin; row < end; ++row) ++count[static_cast<std::size_t>(row)];
  });
  return count;
}

TEST(Parallel, EveryRowIsVisitedOnce) {
  for (const long rows : {0L, 1L, 7L, 8L, 9L, 1000L, 2501L, 100003L})
    for (const int threads : {-1, 0, 1, 2, 3, 8, 1000000}) {
      const std::vector<int> count = visits(rows, threads, 1);
      EXPECT_EQ(std::count(count.begin(), count.end(), 1), rows)
          << rows << " rows, " << threads << " threads";
    }
}

TEST(Parallel, AnExceptionOfAWorkerReachesTheCallerAndThePoolGoesOn) {
  for (int sample = 0; sample < 200; ++sample) {
    const long bad = 8 * (sample % 100);
    const auto body = [&](long begin, long end) {
      if (begin <= bad && bad < end) throw std::runtime_error("row " + std::to_string(bad));
    };
    try {
      parallel_rows(800, 4, 8, body);
      ADD_FAILURE() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()), "row " + std::to_string(bad));
    }
  }
  const std::vector<int> count = visits(5000, 4, 8);
  EXPECT_EQ(std::count(count.begin(), count.end(), 1), 5000);
}

TEST(Parallel, WorkMayStartFromSeveralThreadsAtOnceAndFromWorkers) {
  std::atomic<long> sum{0};
  parallel_rows(64, 4, 8, [&](long begin, long end) {
    for (long row = begin; row < end; ++row)
      parallel_rows(80, 3, 8, [&](long first, long last) { sum += last - first; });
  });
  EXPECT_EQ(sum, 64 * 80);
}

TEST(Parallel, BothPiecesRunAndTheirExceptionsArrive) {
  for (const int threads : {1, 2}) {
    int first = 0, second = 0;
    parallel_both(threads, [&] { first = 1; }, [&] { second = 2; });
    EXPECT_EQ(first + second, 3);
    EXPECT_THROW(
        parallel_both(threads, [] {}, [] { throw std::runtime_error("second"); }), std::runtime_error);
  }
}

struct Stop {};

TEST(Parallel, AnInterruptEndsTheWorkOfAllThreads) {
  set_interrupt_check([] { throw Stop{}; });
  for (const int threads : {1, 4}) {
    std::atomic<long> rows{0};
    EXPECT_THROW(parallel_rows(1L << 40, threads, 8, [&](long begin, long end) { rows += end - begin; }),
                 Stop);
    // Long before the end. The others go on while the thread that is asked waits for a processor: 3e9 rows
    // were seen on two busy cores with sanitizers,
    // so the bound is an eighth of all rows, not a thousandth of them.
    EXPECT_LT(rows, 1L << 37);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));  // until it is asked again
  }
  set_interrupt_check(nullptr);
}

TEST(Parallel, AForkedChildWorksOn) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the thread sanitizer does not follow a fork";
#endif
  visits(1000, 4, 8);
  const pid_t child = fork();
  if (child == 0) {
    const std::vector<int> count = visits(1000, 4, 8);
    _exit(std::accumulate(count.begin(), count.end(), 0) == 1000 ? 0 : 1);
  }
  int status = 1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST(Parallel, AStoppedPoolLeavesTheWorkToItsCaller) {
  ThreadPool pool;
  std::atomic<int> blocks{0};
  pool.run(10, 4, [&](long) { ++blocks; });
  pool.stop();
  pool.run(10, 4, [&](long) { ++blocks; });
  EXPECT_EQ(blocks, 20);
}

}  // namespace
}  // namespace exactarm
