"""Templates of the native program: C++ vectors of lanes by compiler extensions, and the loop."""

PRELUDE = """\
#include <cmath>
#include <cstdint>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace {
// As wide as the machine's vectors; compilers split those that are too wide.
#if defined(__AVX512F__)
constexpr int WIDTH = 64 / sizeof($real);
#else
constexpr int WIDTH = 32 / sizeof($real);
#endif
typedef float f32 __attribute__((vector_size(4 * WIDTH)));
typedef double f64 __attribute__((vector_size(8 * WIDTH)));
typedef int32_t i32 __attribute__((vector_size(4 * WIDTH)));
typedef int64_t i64 __attribute__((vector_size(8 * WIDTH)));
typedef $mask mask;  // in each lane 0 or -1

template <class T> struct Like;
template <> struct Like<f32> { typedef i32 whole; };
template <> struct Like<i32> { typedef i32 whole; };
template <> struct Like<f64> { typedef i64 whole; };
template <> struct Like<i64> { typedef i64 whole; };

#if defined(__clang__)  // at -O1, clang unrolls no loop by itself
#define EACH_LANE _Pragma("clang loop unroll(full)") for (int l = 0; l < WIDTH; ++l)
#else
#define EACH_LANE for (int l = 0; l < WIDTH; ++l)
#endif

template <class T, class Number> inline T all(Number number) {
    T filled;
    EACH_LANE filled[l] = number;
    return filled;
}
template <class T, class From> inline T cast(From from) {
    return __builtin_convertvector(from, T);
}
template <class T> inline T where(mask which, T chosen, T other) {
    return cast<typename Like<T>::whole>(which) ? chosen : other;
}
// Bitwise, since compilers handle ?: of 64-bit integers lane by lane.
template <> inline i64 where<i64>(mask which, i64 chosen, i64 other) {
    const i64 wide = cast<i64>(which);
    return (chosen & wide) | (other & ~wide);
}
// Keeps NaN, as torch does: a number with all bits set is NaN.
template <class T> inline T none(T result, T a) {
    typedef typename Like<T>::whole whole;
    return (T)((whole)result | (a != a));
}
template <class T> inline T maximum(T a, T b) { return none(a > b ? a : b, a); }
template <class T> inline T minimum(T a, T b) { return none(a < b ? a : b, a); }
// For a limit that isn't NaN. If a is NaN, the comparison fails and a stays.
template <class T> inline T at_least(T a, T limit) { return limit > a ? limit : a; }
template <class T> inline T at_most(T a, T limit) { return limit < a ? limit : a; }
template <class T> inline bool anywhere(T which) {
    int64_t parts[sizeof which / 8], any = 0;
    __builtin_memcpy(parts, &which, sizeof which);
    for (int64_t part : parts) any |= part;
    return any != 0;
}
inline bool everywhere(mask which) { return !anywhere(~which); }
template <class T> inline typename Like<T>::whole bits(T a) {
    return (typename Like<T>::whole)a;
}
template <class T> inline mask finite(T a) { return cast<mask>(a - a == 0); }
template <class T> inline mask positive(T a) { return finite(a) & cast<mask>(bits(a) >= 0); }
template <class T> inline mask negative_zero(T a) {
    return cast<mask>(a == 0) & cast<mask>(bits(a) < 0);
}

template <class T, class Number, class Index> inline T lookup(const Number* table, Index index) {
    T found;
    EACH_LANE found[l] = table[index[l]];
    return found;
}
// Each lane reads the element at its own index from an array of vectors.
template <class T, class Index> inline T pick(const T* of, int stride, Index index) {
    T found;
    typedef decltype(found[0] + 0) Number;
    const Number* numbers = (const Number*)of;
    Index at = index * (stride * WIDTH);
    EACH_LANE at[l] += l;
    EACH_LANE found[l] = numbers[at[l]];
    return found;
}
template <class Number, class T> inline void load(T& to, const void* leaf, int64_t place) {
    EACH_LANE to[l] = static_cast<const Number*>(leaf)[place + l];
}
template <class Number, class T> inline void store(T from, void* leaf, int64_t place) {
    EACH_LANE static_cast<Number*>(leaf)[place + l] = from[l];
}
// Applies a scalar function of one or two numbers, in a loop that compilers vectorise.
template <class Number, class T, class Function> inline T each(T x, T y, Function function) {
    alignas(T) Number out[WIDTH], other[WIDTH];
    __builtin_memcpy(out, &x, sizeof out);
    __builtin_memcpy(other, &y, sizeof other);
    _Pragma("omp simd") for (int l = 0; l < WIDTH; ++l) out[l] = function(out[l], other[l]);
    __builtin_memcpy(&x, out, sizeof out);
    return x;
}

// The list of those rows of a family that a step must compute, since they aren't idle.
template <int N> struct Rows {
    int of[N], number, kept;
    bool listed[N];
    void wake_all() {
        for (int row = 0; row < N; ++row) of[row] = row, listed[row] = true;
        number = N;
    }
    template <class Index> void wake(Index index) {
        EACH_LANE {
            const int64_t row = index[l];
            if (row < 0 || row >= N || listed[row]) continue;
            listed[row] = true;
            of[number++] = row;
        }
    }
    int first() { return kept = 0; }
    void next(int row, bool keep) {
        listed[row] = keep;
        of[kept] = row;
        kept += keep;
    }
    void last() { number = kept; }
};

// While it lives, subnormal numbers count as zero: processors are slow with them.
class Flushed {
#if defined(__SSE__)
    const unsigned before = _mm_getcsr();
public:
    Flushed() { _mm_setcsr(before | 0x8040); }  // results and operands
    ~Flushed() { _mm_setcsr(before); }
#elif defined(__aarch64__)
    uint64_t before;
public:
    Flushed() {
        __asm__ volatile("mrs %0, fpcr" : "=r"(before));
        __asm__ volatile("msr fpcr, %0" : : "r"(before | UINT64_C(1) << 24) : "memory");
    }
    ~Flushed() { __asm__ volatile("msr fpcr, %0" : : "r"(before) : "memory"); }
#endif
};
}  // namespace
"""

DECLARATION = """\
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__)
#if __GLIBC_PREREQ(2, 35)
#pragma omp declare simd notinbranch
extern "C" $number $function;
#endif
#endif
"""
"""Declares that the C library has a vector version of a function, with errors up to 4 ulp."""

RUN = """\
struct Memory {  // a vector of lanes' arrays that are too large for the stack
$memory
};

// A leaf is [elements, lanes]; lanes are a multiple of WIDTH.
extern "C" void run(int64_t lanes, int64_t steps, void* const* leaf) {
    const Flushed flushed;
    Memory* const memory = new Memory;  // std::unique_ptr's header takes longer than some programs
$constants
    for (int64_t lane = 0; lane < lanes; lane += WIDTH) {
$arrays
$loads
$once
        for (int64_t step = 0; step < steps; ++step) {
$body
        }
$stores
    }
    delete memory;
}
"""
