// Splits a batch of independent rows over threads: body(begin, end) on each block.
//
// Blocks begin at multiples of eight rows, so that the same eight rows meet in the lanes (lanes.hpp) and
// every number comes out the same, bit for bit,
// whatever the number of threads. Between blocks a signal may end the work.
#pragma once

#include <algorithm>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/base/thread_pool.hpp"

namespace exactarm {

constexpr long kRowsTogether = 8, kMostRowsABlock = 8192;

template <class Body>
void parallel_rows(long rows, int threads, long least_rows_a_thread, const Body& body) {
  const long wanted = std::min<long>(threads, rows / std::max(least_rows_a_thread, 1L));
  const long workers = std::clamp<long>(wanted, 1, ThreadPool::kMostThreads);
  const long share = (rows + workers - 1) / workers, pieces = (share + kMostRowsABlock - 1) / kMostRowsABlock;
  const long piece = pieces > 0 ? (share + pieces - 1) / pieces : 0;
  const long size = std::max((piece + kRowsTogether - 1) / kRowsTogether * kRowsTogether, kRowsTogether);
  const long blocks = (rows + size - 1) / size;
  const auto one = [&](long block) {
    check_interrupt();
    body(block * size, std::min((block + 1) * size, rows));
  };
  if (workers > 1)
    ThreadPool::shared().run(blocks, static_cast<int>(workers), one);
  else
    for (long block = 0; block < blocks; ++block) one(block);
}

// Two pieces of work at once, where there are two threads.
template <class First, class Second>
void parallel_both(int threads, const First& first, const Second& second) {
  const auto one = [&](long block) { block == 0 ? first() : second(); };
  if (threads > 1)
    ThreadPool::shared().run(2, 2, one);
  else
    for (long block : {0L, 1L}) one(block);
}

}  // namespace exactarm
