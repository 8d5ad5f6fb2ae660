#ifndef THICKLENS_ESTIMATOR_BLAS_H_
#define THICKLENS_ESTIMATOR_BLAS_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens::estimator {

// Describes in one line which BLAS this process uses: its name, its version and settings where the
// library reports them, and its file; "none" if the process has no BLAS. The choice is made when
// the program starts: it is the first library with a dgemm_, and for Debian's libblas.so.3 the one
// that update-alternatives names.
THICKLENS_EXPORT std::string BlasDescription();

// While an object of this class exists, OpenBLAS uses one thread for each call: the blocks already
// occupy all cores, and the order of a sum must not depend on the number of cores. The setting
// belongs to the process, not to the thread, so create the object before threads start. The
// destructor restores the former number. Reference BLAS and Debian's ATLAS have no threads and need
// nothing.
class THICKLENS_EXPORT OneBlasThread {
 public:
  // Sets the number of threads of OpenBLAS to one.
  OneBlasThread();
  ~OneBlasThread();
  OneBlasThread(const OneBlasThread&) = delete;
  OneBlasThread& operator=(const OneBlasThread&) = delete;

 private:
  int threads_before_ = 0;  // 0: there is nothing to restore
};

// Makes OpenBLAS use one thread for each call from now on, as OneBlasThread does, and ends the
// threads that OpenBLAS started when it was loaded, one for each core. Each of these threads
// busy-waits for work before it sleeps (2^26 to 2^28 ticks of the clock, 0.03 to 0.1 s), which is
// as long as many an estimate takes, and it does so on the cores that the estimate needs.
//
// Call this function before other threads start. It leaves the threads alone where memory is so
// short that they may not have started: such a thread retries forever, and waiting for it would
// never end. If the program sets another number later, OpenBLAS starts new threads. Another BLAS
// needs nothing.
THICKLENS_EXPORT void KeepBlasToOneThread();

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLAS_H_
