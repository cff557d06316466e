// Thread pool: threads that share out the numbered pieces of a call.
//
// Which thread takes a piece is left to chance, so a piece must never depend on another one of the same call: then no
// result depends on the number of threads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <new>

namespace hemivar {

class Pool {
public:
    static Pool& shared();
    // In a child after a fork: its threads are gone, and nobody knows what they held.
    static void renew();
    static void set_threads(int count);

    void run(int64_t pieces, void (*call)(void*, int64_t), void* data);

private:
    explicit Pool(int threads) : threads_(threads) {}
    void start();
    void work();
    bool take();

    int threads_;
    Pool* before_ = nullptr;  // the one that it replaced
    bool started_ = false;
    std::mutex one_call_;
    void (*call_)(void*, int64_t) = nullptr;
    void* data_ = nullptr;
    std::atomic<int64_t> left_{0}, undone_{0};
    std::atomic<int> sleepers_{0};
    std::mutex sleep_;
    std::condition_variable wake_;
};

// work(piece) for all pieces. What one of them throws is thrown here, as a lack of memory.
template <class Work>
void share(int64_t pieces, const Work& work) {
    if (pieces <= 0) return;
    if (pieces == 1) return work(int64_t{0});
    struct Call {
        const Work& work;
        std::atomic<bool> failed{false};
    } call{work};
    Pool::shared().run(
        pieces,
        [](void* data, int64_t piece) {
            Call& one = *static_cast<Call*>(data);
            try {
                one.work(piece);
            } catch (...) {
                one.failed.store(true);
            }
        },
        &call);
    if (call.failed.load()) throw std::bad_alloc();
}

}  // namespace hemivar
