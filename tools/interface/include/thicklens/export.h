#ifndef THICKLENS_EXPORT_H_
#define THICKLENS_EXPORT_H_

// Marks what the shared library exports. The library is compiled with -fvisibility=hidden, so that
// a symbol without this mark is private; tests/architecture/exported_symbols_test.cc lists the
// marked ones.
#if defined(__GNUC__) || defined(__clang__)
#define THICKLENS_EXPORT __attribute__((visibility("default")))
#else
#define THICKLENS_EXPORT
#endif

#endif  // THICKLENS_EXPORT_H_
