// Threads that wait for blocks of independent work and live from the first use to the end of the process.
//
// The caller works too, so that work ends even where no thread could be started, and several callers may come
// at once. An exception in a block ends the others early and is thrown again in the caller once all have
// ended. A child of fork() starts with a pool of its own that is empty.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace exactarm {

class ThreadPool {
 public:
  static constexpr int kMostThreads = 256;

  static ThreadPool& shared();

  ThreadPool() = default;
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;
  ~ThreadPool() { stop(); }

  // work(block) for each block from 0 on, by at most `threads` threads.
  // `work` may be called from all of them at once.
  template <class Work>
  void run(long blocks, int threads, const Work& work) {
    run_blocks(blocks, threads, &work,
               [](const void* self, long block) { (*static_cast<const Work*>(self))(block); });
  }

  // Ends all threads; later work is done by its callers alone.
  void stop();

 private:
  struct Job;
  void run_blocks(long blocks, int threads, const void* work, void (*call)(const void*, long));
  void start_workers(int wanted);
  void serve();
  Job* open_job() const;

  std::mutex mutex_;
  std::condition_variable wake_, done_;
  std::vector<std::thread> workers_;
  Job* jobs_ = nullptr;  // a list of those that callers wait for
  bool stopping_ = false;
};

}  // namespace exactarm
