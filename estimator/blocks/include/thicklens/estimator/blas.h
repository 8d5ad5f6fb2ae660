#ifndef THICKLENS_ESTIMATOR_BLAS_H_
#define THICKLENS_ESTIMATOR_BLAS_H_

#include <string>

namespace thicklens::estimator {

// Which BLAS this process got, in one line: name, version and settings where it tells them, and the
// file; "none" if there is no BLAS in it. It is chosen when the program starts: the first library
// with a dgemm_, and of Debian's libblas.so.3 the one that update-alternatives names.
std::string BlasDescription();

// While it lives, OpenBLAS uses one thread for each call: blocks are solved on all cores already,
// and sums must not be split in another way on another number of cores. The setting is the
// process's, not the thread's: make one before threads start. The former number comes back at the
// end. Reference BLAS and Debian's ATLAS need nothing: they have no threads.
class OneBlasThread {
 public:
  OneBlasThread();
  ~OneBlasThread();
  OneBlasThread(const OneBlasThread&) = delete;
  OneBlasThread& operator=(const OneBlasThread&) = delete;

 private:
  int threads_before_ = 0;  // 0: there is nothing to bring back
};

// From now on OpenBLAS uses one thread for each call, as with OneBlasThread, and the threads that
// it started when it was loaded, one a core, are ended. Each of them waits for work busily before
// it sleeps (2^26 to 2^28 ticks of the clock, .03 to .1 s): as long as many an estimate takes, and
// on the cores that its threads need. To be called before other threads start. The threads are left
// where memory is so short that they may not have begun: they try forever, and could not be waited
// for. A program that sets another number later gets new ones. Another BLAS needs nothing.
void KeepBlasToOneThread();

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLAS_H_
