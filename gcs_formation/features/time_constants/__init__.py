"""Online estimation of each vehicle's time constants in equation (7).

**Problem.** Delay compensation predicts a vehicle's state through the setpoints that are still in flight, by the
model's time constants. Constants that are 30 % off cost 0.08 to 0.16 m after a step of the wind at 300 ms each way
(docs/latency.md), and part of the delay margin. Time constants differ between aircraft, speeds and parameter sets, and
no one measures them before a flight.

**Method.** Output-error identification (L. Ljung, "System Identification", 2nd ed., 4.2 and 10.2) by a model set: every
vehicle is simulated from its setpoints alone, by five models each of airspeed and heading, and sixteen of height (two
time constants). Their constants lie at Chebyshev points of the logarithm of the ratio to the declared one, from half to
double, so that a polynomial interpolates the simulated motion between them (`fit.Nodes`), and its derivative comes with
it. Products of residuals are summed once a sample; a Gauss-Newton step on the sums needs no simulation of its own. A
normal prior about the declared constant (0.35 in the logarithm) holds what nothing excites.

Residuals aren't white: a gust moves a vehicle for seconds, and all samples within it say the same once. Von Neumann's
ratio of successive batch means (Annals of Mathematical Statistics 12, 1941) gives for how many batches they stay
correlated, and the information is divided by that (`fit.Persistence`). Samples are forgotten only as new excitation
comes in; in straight flight nothing is estimated and nothing is lost.

**Why this.** Regression of the measured acceleration on the measured state (equation error) is simpler, and biased by
noise in the regressors: at 10 Hz a rounded airspeed is mostly noise. An extended Kalman filter with the constants as
states linearises about one value, needs tuned process noise, and takes a lasting gust for a change of the constants.
Recursive least squares with a forgetting factor forgets in straight flight, and its gain grows until noise decides.

**Costs and limits.** 26 scalar simulations for each vehicle and tick. The true constant must be within a factor of two
of the declared one; beyond it the bound is used, and `mismatch` reports that it lies farther off. At a rate limit, over
gaps of telemetry, and while a vehicle doesn't conform nothing is estimated. Vehicles with an airframe of their own, and
multirotors, don't fly by (7): theirs stay as declared. A sensor's constant bias isn't fitted, and does no harm.

**Shown by** `tests/gcs_formation/features/time_constants/test_estimation.py`; what it is worth in a flight by the table
"What if the model isn't the vehicle" of docs/latency.md (`python -m benchmarks.headlines --page latency`).
"""
