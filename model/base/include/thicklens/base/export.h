#ifndef THICKLENS_BASE_EXPORT_H_
#define THICKLENS_BASE_EXPORT_H_

// Marks what a library of the project exports. The libraries are compiled with hidden visibility,
// so that a program cannot come to depend on a function that no header declares, and calls within a
// library are direct. The mark is on every function of a header that a source defines, and on each
// type and variable that must be one and the same in all libraries: exceptions, which are thrown in
// one library and caught in another, classes with virtual functions, and the token of cancel.h.
// tests/architecture/exported_symbols lists what is exported.
#if defined(__GNUC__) || defined(__clang__)
#define THICKLENS_EXPORT __attribute__((visibility("default")))
#else
#define THICKLENS_EXPORT
#endif

#endif  // THICKLENS_BASE_EXPORT_H_
