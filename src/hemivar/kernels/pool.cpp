#include "pool.hpp"

#include <chrono>
#include <thread>

namespace hemivar {

namespace {

constexpr auto kSpin = std::chrono::microseconds(20);

std::atomic<Pool*> pool{nullptr}, last{nullptr};
std::atomic<int> wanted{1};

}  // namespace

// A pool is never deleted: its threads sleep until the process ends.
Pool& Pool::shared() {
    Pool* found = pool.load();
    if (found == nullptr) {
        Pool* made = new Pool(wanted.load());
        if (pool.compare_exchange_strong(found, made)) {
            made->before_ = last.exchange(made);
            return *made;
        }
        delete made;  // another thread was faster
    }
    return *found;
}

void Pool::renew() { pool.store(nullptr); }

void Pool::set_threads(int count) {
    if (wanted.exchange(count) != count) renew();
}

void Pool::start() {
    started_ = true;
    for (int k = 1; k < threads_; ++k) {
        try {
            std::thread([this] { work(); }).detach();
        } catch (...) {  // no thread, or no memory for one
            return;  // fewer threads will do
        }
    }
}

bool Pool::take() {
    int64_t left = left_.load();
    while (left > 0) {
        if (left_.compare_exchange_weak(left, left - 1)) {
            // The call cannot end before this piece is done, so what it works on is still there.
            call_(data_, left - 1);
            undone_.fetch_sub(1);
            return true;
        }
    }
    return false;
}

void Pool::work() {
    for (;;) {
        for (auto begin = std::chrono::steady_clock::now();;) {
            if (take()) {
                begin = std::chrono::steady_clock::now();
            } else if (std::chrono::steady_clock::now() - begin >= kSpin) {
                break;
            } else {
                std::this_thread::yield();
            }
        }
        std::unique_lock<std::mutex> lock(sleep_);
        sleepers_.fetch_add(1);
        wake_.wait(lock, [this] { return left_.load() > 0; });
        sleepers_.fetch_sub(1);
    }
}

void Pool::run(int64_t pieces, void (*call)(void*, int64_t), void* data) {
    // Of two Python threads the second one works alone.
    std::unique_lock<std::mutex> lock(one_call_, std::try_to_lock);
    if (threads_ <= 1 || !lock.owns_lock()) {
        for (int64_t piece = 0; piece < pieces; ++piece) call(data, piece);
        return;
    }
    if (!started_) start();
    call_ = call;
    data_ = data;
    undone_.store(pieces);
    left_.store(pieces);
    if (sleepers_.load() > 0) {
        { std::lock_guard<std::mutex> guard(sleep_); }
        wake_.notify_all();
    }
    while (take()) {
    }
    while (undone_.load() > 0) std::this_thread::yield();
}

}  // namespace hemivar
