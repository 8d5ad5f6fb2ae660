#ifndef THICKLENS_MODEL_SIMULATE_SQUARE_WAVE_H_
#define THICKLENS_MODEL_SIMULATE_SQUARE_WAVE_H_

namespace thicklens::model {

// Mean over [x - width/2, x + width/2], width > 0, of a wave that is +1 on the first half of each
// period and -1 on the second.
double SquareWaveMean(double x, double period, double width);

// Mean of a star of `cycles` pairs of sectors, +1 and -1, around (0, 0), over a cell of side `cell`
// around (x, y). The mean is taken only along the circle through (x, y).
double StarMean(double x, double y, double cycles, double cell);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SQUARE_WAVE_H_
