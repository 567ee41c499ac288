#include "exactarm/base/thread_pool.hpp"

#include <pthread.h>

#include <algorithm>
#include <exception>
#include <system_error>

#include "exactarm/base/interrupt.hpp"

namespace exactarm {
namespace {

// Never destroyed: threads of an ending interpreter may still hold it.
ThreadPool*& shared_pool() {
  static ThreadPool* pool = [] {
    // The threads are the parent's: the child leaves that pool alone and takes a new one.
    pthread_atfork(nullptr, nullptr, [] {
      shared_pool() = new ThreadPool;
    });
    return new ThreadPool;
  }();
  return pool;
}

}  // namespace

// On the stack of the caller, who waits until no worker holds it.
struct ThreadPool::Job {
  const void* work;
  void (*call)(const void*, long);
  long blocks;
  int most_helpers;

  Job* after = nullptr;
  int helpers = 0;  // workers that hold it; with `after` and `error` under the pool's mutex
  std::exception_ptr error = nullptr;
  std::atomic<long> next{0};
  std::atomic<bool> failed{false};

  bool is_open() const { return helpers < most_helpers && next < blocks && !failed; }

  // Blocks until none is left; returns the exception of the one that failed.
  std::exception_ptr take_blocks() {
    try {
      while (!failed) {
        const long block = next.fetch_add(1);
        if (block >= blocks) break;
        call(work, block);
      }
    } catch (const Cancelled&) {  // another one failed first, and has kept the reason
    } catch (...) {
      failed = true;
      return std::current_exception();
    }
    return nullptr;
  }
};

ThreadPool& ThreadPool::shared() { return *shared_pool(); }

ThreadPool::Job* ThreadPool::open_job() const {
  for (Job* job = jobs_; job; job = job->after)
    if (job->is_open()) return job;
  return nullptr;
}

void ThreadPool::start_workers(int wanted) {
  try {
    while (static_cast<int>(workers_.size()) < wanted) workers_.emplace_back([this] { serve(); });
  } catch (const std::system_error&) {  // no more threads to be had: those that are there do the work
  }
}

void ThreadPool::serve() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    Job* job = nullptr;
    wake_.wait(lock, [&] { return stopping_ || (job = open_job()); });
    if (stopping_) return;
    ++job->helpers;
    lock.unlock();
    std::exception_ptr error;
    {
      const WorkerScope scope(job->failed);
      error = job->take_blocks();
    }
    lock.lock();
    if (error && !job->error) job->error = std::move(error);
    if (--job->helpers == 0) done_.notify_all();
  }
}

void ThreadPool::run_blocks(long blocks, int threads, const void* work, void (*call)(const void*, long)) {
  const int helpers = static_cast<int>(std::min<long>({threads, blocks, kMostThreads})) - 1;
  Job job{work, call, blocks, std::max(helpers, 0)};
  if (helpers > 0) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!stopping_) start_workers(helpers);
    job.after = jobs_;
    jobs_ = &job;
    wake_.notify_all();
  }
  std::exception_ptr error = job.take_blocks();
  if (helpers > 0) {
    std::unique_lock<std::mutex> lock(mutex_);
    Job** place = &jobs_;
    while (*place != &job) place = &(*place)->after;
    *place = job.after;
    done_.wait(lock, [&] { return job.helpers == 0; });
    if (!error) error = job.error;
  }
  if (error) std::rethrow_exception(error);
}

void ThreadPool::stop() {
  std::vector<std::thread> workers;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    workers.swap(workers_);
  }
  wake_.notify_all();
  for (std::thread& worker : workers) worker.join();
}

}  // namespace exactarm
