#ifndef THICKLENS_KERNELS_CPU_PROCESSOR_H_
#define THICKLENS_KERNELS_CPU_PROCESSOR_H_

namespace thicklens::kernels {

// The questions by which loops with vector instructions are chosen when the program runs. They are
// two, because FMA rounds a product and a sum once where AVX2 alone rounds twice: loops that must
// give the same bits on every processor ask for AVX2 alone. A file that is compiled for one kind of
// processor may not include this header (see filter_loops.h).
#if defined(__x86_64__)
inline bool HasAvx2() { return __builtin_cpu_supports("avx2"); }
inline bool HasAvx2AndFma() { return HasAvx2() && __builtin_cpu_supports("fma"); }
#else
inline bool HasAvx2() { return false; }
inline bool HasAvx2AndFma() { return false; }
#endif

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_PROCESSOR_H_
