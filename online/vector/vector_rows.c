/* Rows of the Bellman error (17) and what the critic laws need of them, some rows a vector.

   A block is LANES rows and its arrays have the lanes innermost: omega[block][l][lane]. m, the number of
   functions, is rounded up to a multiple of 8, the number of rows to one of 2 LANES; what is beyond is zero.
   A sum over rows stays in its lanes until it is complete, so that the compiler need not reorder one. */

#include <math.h>

#if defined __AVX512F__
enum { LANES = 8 };
#elif defined __AVX__
enum { LANES = 4 };
#else
enum { LANES = 2 };
#endif

typedef double vector __attribute__((vector_size(8 * LANES)));
typedef double anywhere __attribute__((vector_size(8 * LANES), aligned(8)));
typedef long long integer;

const integer lanes = LANES;

enum { PAPER, STATE_COST };
enum { MOST = 64 }; /* Lanczos vectors */

typedef struct {
  integer blocks, m, n, k, entries, normalizer;
  double floor;
  const integer *column;     /* (n + 1) where the columns of sigma' start; multiples of 4 */
  const integer *row;        /* of each entry of sigma' */
  const integer *input;      /* (k + 1) where the columns of g start */
  const integer *state;      /* row of each entry of g */
  const double *R_inverse;   /* (k, k) */
  const double *D_inverse;   /* (k, k) gamma^-2 W_d^-1 */
  const vector *terms;           /* (blocks, entries) sigma', f, g, zeta'Q zeta */
  const vector *gains;           /* (blocks) eta_c of each row */
  vector *omega;                 /* (blocks, m) */
  vector *local_cost, *delta, *weights; /* (blocks) */
  vector *work;                  /* (3 n + 2 k + m) */
} table;

static const vector zero;

static double sum(vector a) {
  double total[LANES];
  for (int lane = 0; lane < LANES; ++lane) total[lane] = a[lane];
  for (int half = LANES / 2; half; half /= 2)
    for (int lane = 0; lane < half; ++lane) total[lane] += total[lane + half];
  return total[0];
}

static double dot(integer m, const double *a, const double *b) {
  const anywhere *x = (const anywhere *)a, *y = (const anywhere *)b;
  vector s = zero;
  for (integer l = 0; l < m / LANES; ++l) s += x[l] * y[l];
  double total = sum(s);
  for (integer l = m / LANES * LANES; l < m; ++l) total += a[l] * b[l];
  return total;
}

/* rows'x of a block, rows (m, LANES) */
static vector product(integer m, const vector *rows, const double *x) {
  vector s0 = zero, s1 = s0, s2 = s0, s3 = s0;
  for (integer l = 0; l < m; l += 4) {
    s0 += rows[l] * x[l];
    s1 += rows[l + 1] * x[l + 1];
    s2 += rows[l + 2] * x[l + 2];
    s3 += rows[l + 3] * x[l + 3];
  }
  return (s0 + s1) + (s2 + s3);
}

/* p = sigma'^T W_1 and q = sigma'^T W_2 of a block, each (n) */
static void gradients(const table *t, const vector *sigma_prime, const double *W_1, const double *W_2, vector *p,
                      vector *q) {
  for (integer i = 0; i < t->n; ++i) {
    vector a0 = zero, a1 = a0, b0 = a0, b1 = a0;
    for (integer e = t->column[i]; e < t->column[i + 1]; e += 2) {
      const integer r0 = t->row[e], r1 = t->row[e + 1];
      a0 += sigma_prime[e] * W_1[r0];
      b0 += sigma_prime[e] * W_2[r0];
      a1 += sigma_prime[e + 1] * W_1[r1];
      b1 += sigma_prime[e + 1] * W_2[r1];
    }
    p[i] = a0 + a1;
    q[i] = b0 + b1;
  }
}

/* F = f + g (u_1 + u_2) of a block; returns r. With p = g'sigma'^T W_1 and q = g'sigma'^T W_2:
   u_1 = -R^-1 p / 2, u_2 = D^-1 q / 2, u_1'R u_1 - gamma^2 u_2'W_d u_2 = -(p'u_1 + q'u_2) / 2 */
static vector closed_loop(const table *t, const vector *f, vector *work, vector *F) {
  const integer n = t->n, k = t->k;
  const vector *g = f + n, *p = work, *q = p + n;
  vector *push_1 = work + 3 * n, *push_2 = push_1 + k, cost = g[t->input[k]];
  for (integer j = 0; j < k; ++j) {
    push_1[j] = push_2[j] = zero;
    for (integer e = t->input[j]; e < t->input[j + 1]; ++e) {
      push_1[j] += g[e] * p[t->state[e]];
      push_2[j] += g[e] * q[t->state[e]];
    }
  }
  for (integer i = 0; i < n; ++i) F[i] = f[i];
  for (integer j = 0; j < k; ++j) {
    vector u_1 = zero, u_2 = u_1;
    for (integer i = 0; i < k; ++i) {
      u_1 -= 0.5 * t->R_inverse[j * k + i] * push_1[i];
      u_2 += 0.5 * t->D_inverse[j * k + i] * push_2[i];
    }
    cost -= 0.5 * (push_1[j] * u_1 + push_2[j] * u_2);
    u_1 += u_2;
    for (integer e = t->input[j]; e < t->input[j + 1]; ++e) F[t->state[e]] += g[e] * u_1;
  }
  return cost;
}

static vector row_weights(const table *t, integer b, const vector *omega, vector state_cost) {
  vector size = zero + 1.0, weights = t->gains[b];
  if (t->normalizer == STATE_COST) return weights / ((state_cost + t->floor) * (state_cost + t->floor));
  for (integer l = 0; l < t->m; ++l) size += omega[l] * omega[l];
  for (int lane = 0; lane < LANES; ++lane) size[lane] = sqrt(size[lane]);
  return weights / size;
}

/* omega, r, delta and weights of all rows, and gradient (m) = sum of w omega delta */
void bellman(const table *t, const double *critic, const double *actor_1, const double *actor_2,
             double *gradient) {
  const integer m = t->m, n = t->n;
  vector *work = t->work, *F = work + 2 * n, *sums = work + 3 * n + 2 * t->k;
  for (integer l = 0; l < m; ++l) sums[l] = zero;
  for (integer b = 0; b < t->blocks; ++b) {
    const vector *sigma_prime = t->terms + b * t->entries, *f = sigma_prime + t->column[n];
    vector *omega = t->omega + b * m;
    gradients(t, sigma_prime, actor_1, actor_2, work, work + n);
    t->local_cost[b] = closed_loop(t, f, work, F);
    for (integer l = 0; l < m; ++l) omega[l] = zero;
    for (integer i = 0; i < n; ++i)
      for (integer e = t->column[i]; e < t->column[i + 1]; ++e) omega[t->row[e]] += sigma_prime[e] * F[i];
    t->delta[b] = t->local_cost[b] + product(m, omega, critic);
    t->weights[b] = row_weights(t, b, omega, sigma_prime[t->entries - 1]);
    const vector pull = t->weights[b] * t->delta[b];
    for (integer l = 0; l < m; ++l) sums[l] += pull * omega[l];
  }
  for (integer l = 0; l < m; ++l) gradient[l] = sum(sums[l]);
}

/* y = (sum of w omega omega' + diag(leash)) x; the number of blocks is even */
static void multiply(const table *t, const double *leash, const double *x, double *y) {
  const integer m = t->m;
  vector *sums = t->work + 3 * t->n + 2 * t->k;
  for (integer l = 0; l < m; ++l) sums[l] = zero;
  for (integer b = 0; b < t->blocks; b += 2) {
    const vector *first = t->omega + b * m, *second = first + m;
    const vector pull_1 = t->weights[b] * product(m, first, x);
    const vector pull_2 = t->weights[b + 1] * product(m, second, x);
    for (integer l = 0; l < m; ++l) sums[l] += pull_1 * first[l] + pull_2 * second[l];
  }
  for (integer l = 0; l < m; ++l) y[l] = sum(sums[l]) + leash[l] * x[l];
}

/* z(dt) of z' = -T z + size e_1, z(0) = 0, by Taylor's series in steps h with |T| h <= 4; T is tridiagonal,
   all arrays have a zero at either end. Returns the integral of z_n. */
static double small_flow(integer n, const double *diagonal, const double *off, double size, double dt,
                         double norm, double *z) {
  const integer steps = (integer)(norm * dt / 4.0) + 1;
  const double h = dt / (double)steps;
  double rate[MOST + 2], next[MOST + 2], integral = 0.0;
  for (integer i = 0; i < n + 2; ++i) z[i] = rate[i] = next[i] = 0.0;
  for (integer s = 0; s < steps; ++s) {
    double last = z[n];
    for (integer i = 1; i <= n; ++i)
      rate[i] = -(diagonal[i] * z[i] + off[i - 1] * z[i - 1] + off[i] * z[i + 1]);
    rate[1] += size;
    for (int order = 1; order <= 32; ++order) {
      const double c = h / order;
      integral += c * last;
      for (integer i = 1; i <= n; ++i) z[i] += rate[i] *= c;
      last = rate[n];
      for (integer i = 1; i <= n; ++i)
        next[i] = -(diagonal[i] * rate[i] + off[i - 1] * rate[i - 1] + off[i] * rate[i + 1]);
      for (integer i = 1; i <= n; ++i) rate[i] = next[i];
    }
  }
  return integral;
}

/* moved (m) = y(dt) of y' = -A y + gradient, y(0) = 0, A = sum of w omega omega' + diag(leash), in the Krylov
   space of gradient. Returns its dimension once the bound of the error is below tolerance |y|, or -1. */
integer flow(const table *t, const double *leash, const double *gradient, double dt, double tolerance,
             double *vectors, double *moved) {
  const integer m = t->m;
  double diagonal[MOST + 2] = {0}, off[MOST + 2] = {0}, z[MOST + 2], norm = 0.0;
  const double size = sqrt(dot(m, gradient, gradient));
  for (integer l = 0; l < m; ++l) moved[l] = 0.0;
  if (size == 0.0) return 0;
  for (integer l = 0; l < m; ++l) vectors[l] = gradient[l] / size;
  for (integer n = 1, check = 6; n <= MOST; ++n) {
    double *here = vectors + (n - 1) * m, *next = here + m;
    multiply(t, leash, here, next);
    diagonal[n] = dot(m, here, next);
    for (integer l = 0; l < m; ++l) next[l] -= diagonal[n] * here[l];
    if (n > 1)
      for (integer l = 0; l < m; ++l) next[l] -= off[n - 1] * vectors[(n - 2) * m + l];
    const double beta = sqrt(dot(m, next, next)), row = diagonal[n] + off[n - 1] + beta;
    if (row > norm) norm = row;
    if (!(norm * dt < 400.0)) return -1;
    if (n == check || beta <= 1e-13 * norm) {
      const double missed = beta * fabs(small_flow(n, diagonal, off, size, dt, norm, z));
      if (missed <= tolerance * sqrt(dot(n, z + 1, z + 1))) {
        for (integer i = 0; i < n; ++i)
          for (integer l = 0; l < m; ++l) moved[l] += z[i + 1] * vectors[i * m + l];
        return n;
      }
      check = n + 2 + n / 8;
    }
    off[n] = beta;
    for (integer l = 0; l < m; ++l) next[l] /= beta;
  }
  return -1;
}

/* matrix (m, m) = sum of w omega omega', in tiles of 4 x 4 and chunks of rows that stay in the cache */
void normal(const table *t, double *matrix) {
  const integer m = t->m, chunk = 40;
  for (integer start = 0; start < t->blocks; start += chunk) {
    const integer end = start + chunk < t->blocks ? start + chunk : t->blocks;
    for (integer i = 0; i < m; i += 4)
      for (integer j = i; j < m; j += 4) {
        vector s[4][4];
        for (int a = 0; a < 4; ++a)
          for (int c = 0; c < 4; ++c) s[a][c] = zero;
        for (integer b = start; b < end; ++b) {
          const vector *x = t->omega + b * m + i, *y = t->omega + b * m + j, w = t->weights[b];
          for (int a = 0; a < 4; ++a) {
            const vector weighted = w * x[a];
            for (int c = 0; c < 4; ++c) s[a][c] += weighted * y[c];
          }
        }
        for (int a = 0; a < 4; ++a)
          for (int c = 0; c < 4; ++c) {
            double *entry = matrix + (i + a) * m + j + c;
            *entry = (start ? *entry : 0.0) + sum(s[a][c]);
          }
      }
  }
  for (integer i = 0; i < m; ++i)
    for (integer j = 0; j < i; ++j) matrix[i * m + j] = matrix[j * m + i];
}

/* x (m) <- (L L')^-1 x, L the lower triangle of a column-major (m, m) matrix; four columns at a time, whose
   entries of x would otherwise wait for each other through memory */
static void solve(integer m, const double *L, double *x) {
  for (integer j = 0; j < m; j += 4) {
    const integer end = j + 4 < m ? j + 4 : m;
    for (integer a = j; a < end; ++a) {
      x[a] /= L[a * m + a];
      for (integer i = a + 1; i < end; ++i) x[i] -= x[a] * L[a * m + i];
    }
    if (end == m) break;
    const double *c0 = L + j * m, *c1 = c0 + m, *c2 = c1 + m, *c3 = c2 + m;
    const double x0 = x[j], x1 = x[j + 1], x2 = x[j + 2], x3 = x[j + 3];
    for (integer i = end; i < m; ++i) x[i] -= (x0 * c0[i] + x1 * c1[i]) + (x2 * c2[i] + x3 * c3[i]);
  }
  for (integer j = (m - 1) / 4 * 4; j >= 0; j -= 4) {
    const integer end = j + 4 < m ? j + 4 : m, left = m - end;
    for (integer a = j; a < end; ++a) x[a] -= dot(left, L + a * m + end, x + end);
    for (integer a = end - 1; a >= j; --a) {
      for (integer i = a + 1; i < end; ++i) x[a] -= x[i] * L[a * m + i];
      x[a] /= L[a * m + a];
    }
  }
}

/* Lanczos' method for (L L')^-1 from vectors[0] (unit length): its tridiagonal matrix, off[i] beside
   diagonal[i] and diagonal[i + 1]. Returns the number of steps, fewer than asked for when nothing is left. */
integer inverse_lanczos(integer m, const double *L, integer steps, double *vectors, double *diagonal,
                        double *off) {
  for (integer n = 0; n < steps; ++n) {
    double *here = vectors + n * m, *next = here + m;
    for (integer l = 0; l < m; ++l) next[l] = here[l];
    solve(m, L, next);
    diagonal[n] = dot(m, here, next);
    for (integer l = 0; l < m; ++l) next[l] -= diagonal[n] * here[l];
    if (n)
      for (integer l = 0; l < m; ++l) next[l] -= off[n - 1] * vectors[(n - 1) * m + l];
    off[n] = sqrt(dot(m, next, next));
    if (off[n] <= 1e-14 * diagonal[0]) return n + 1;
    for (integer l = 0; l < m; ++l) next[l] /= off[n];
  }
  return steps;
}
