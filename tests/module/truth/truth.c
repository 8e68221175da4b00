// SPDX-License-Identifier: GPL-2.0-or-later
// The rigid machine in long double: leg equations, Newton corrections, and detection of singular poses.
//
// It shares no code with the module and is based on docs/ and the papers' equations. Poses are those
// of the center point D = P + R center with the angles A B C (machine units, degrees): the legs use D with
// held and table letters replaced by 0, a table joint is its letter of D. Angles are multiplied by the platform's
// radius, so that all unknowns are lengths.

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define LEGS 8
#define MOST 6

typedef long double ld;

enum { STRUT, SLIDER, CRANK, RING };

// In the layout of truth.rs: only doubles, so that both languages have the same layout.
struct leg {
    double kind, base[3], platform[3], first[3], second[3], rod, side, lead;
};

struct machine {
    double legs, size, radius;
    // 1 if legs move the letter, 2 if a table does, 0 if it is held.
    double letters[6];
    double centre[3];
    struct leg leg[LEGS];
    // cos of the fold phi0 of each strut: 1 or -1.
    double fold[LEGS];
};

// The result of a check at a pose.
struct fold {
    // Smallest singular value, its steepest slope, distance of the singular pose.
    double sigma, curvature, distance;
    // Least margin of the legs: 1 is comfortable, 0 is the end of a leg's range.
    double margin;
    // Sign of the determinant; 0 for more legs than coordinates.
    double sign;
};

struct followed {
    // Least distance of a singular pose and least margin on the path, length of the path, steps.
    double distance, margin, length, steps;
};

static const ld DEGREE = 3.14159265358979323846264338327950288L / 180;

static ld dot(const ld a[3], const ld b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const ld a[3], const ld b[3], ld c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static ld norm(const ld a[3]) { return sqrtl(dot(a, a)); }

static void unit(const double a[3], ld u[3])
{
    ld v[3] = { a[0], a[1], a[2] };
    const ld n = norm(v);
    for (int k = 0; k < 3; k++) u[k] = n > 0 ? v[k] / n : 0;
}

// Computes the rotation and the map of (dA, dB, dC) to the angular velocity, columns in `rates`.
static void rotation(const ld p[6], ld r[3][3], ld rates[3][3])
{
    const ld sa = sinl(p[3] * DEGREE), ca = cosl(p[3] * DEGREE);
    const ld sb = sinl(p[4] * DEGREE), cb = cosl(p[4] * DEGREE);
    const ld sc = sinl(p[5] * DEGREE), cc = cosl(p[5] * DEGREE);
    const ld m[3][3] = {
        { cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa },
        { sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa },
        { -sb, cb * sa, cb * ca },
    };
    memcpy(r, m, sizeof m);
    if (rates) {
        const ld e[3][3] = { { cc * cb, sc * cb, -sb }, { -sc, cc, 0 }, { 0, 0, 1 } };
        memcpy(rates, e, sizeof e);
    }
}

static void turn(ld r[3][3], const ld v[3], ld out[3])
{
    for (int k = 0; k < 3; k++) out[k] = dot(r[k], v);
}

// Computes the lower end of a leg at a joint value, and its derivative (per radian or length).
static void lower_end(const struct leg *leg, ld q, ld c[3], ld move[3])
{
    ld k[3], arm[3] = { leg->second[0], leg->second[1], leg->second[2] };
    for (int i = 0; i < 3; i++) {
        c[i] = leg->base[i];
        move[i] = 0;
    }
    if (leg->kind == SLIDER) {
        unit(leg->first, move);
        for (int i = 0; i < 3; i++) c[i] += q * move[i];
    } else if (leg->kind == CRANK) {
        ld across[3], turned[3];
        unit(leg->first, k);
        cross(k, arm, across);
        const ld s = sinl(q * DEGREE), o = cosl(q * DEGREE), along = dot(k, arm);
        for (int i = 0; i < 3; i++) turned[i] = arm[i] * o + across[i] * s + k[i] * along * (1 - o);
        cross(k, turned, move);
        for (int i = 0; i < 3; i++) c[i] += turned[i];
    }
}

// Computes the nut's part of a strut's joint value, and the contributions w and z to its row: w per velocity,
// rho x w + z per angular velocity.
static ld nut(const struct leg *leg, ld fold, const ld n[3], ld l, ld r[3][3], ld w[3], ld z[3], ld *margin)
{
    ld a[3], own[3], b[3], ab[3], an[3], bn[3];
    unit(leg->first, a);
    unit(leg->second, own);
    turn(r, own, b);
    cross(a, b, ab);
    cross(a, n, an);
    cross(b, n, bn);
    const ld alpha = dot(a, n), beta = dot(b, n);
    const ld s = dot(n, ab), c = dot(a, b) - alpha * beta;
    const ld fa = 1 - alpha * alpha, fb = 1 - beta * beta;
    const ld per_turn = leg->lead / (360 * DEGREE);
    for (int k = 0; k < 3; k++) {
        w[k] = fold * per_turn * (beta * bn[k] / fb - alpha * an[k] / fa) / l;
        z[k] = fold * per_turn * (n[k] - beta * b[k]) / fb;
    }
    // The module may refuse beyond 170 degrees, and along an axis.
    const ld length = hypotl(s, c);
    const ld turned = (1 + fold * c / length) / 0.1L, lies = fminl(fa, fb) / 0.01L;
    *margin = fminl(*margin, fminl(turned, lies));
    return fold * per_turn * atan2l(fold * s, fold * c);
}

// A leg at a pose, as in the legs' equations.
struct span {
    // From base to platform anchor; lever of the anchor about D.
    ld from_base[3], lever[3];
};

static void spanned(const struct machine *m, const ld p[6], ld r[3][3], int i, struct span *at, ld *margin)
{
    const struct leg *leg = &m->leg[i];
    const ld b[3] = { leg->platform[0] - m->centre[0], leg->platform[1] - m->centre[1],
                      leg->platform[2] - m->centre[2] };
    turn(r, b, at->lever);
    for (int k = 0; k < 3; k++)
        at->from_base[k] = (m->letters[k] == 1 ? p[k] : 0) + at->lever[k] - leg->base[k];
    if (leg->kind == RING && leg->rod != 0) {
        const ld axis[3] = { r[0][2], r[1][2], r[2][2] };
        ld out[3];
        const ld along = dot(axis, at->from_base);
        for (int k = 0; k < 3; k++) out[k] = along * axis[k] - at->from_base[k];
        const ld across = norm(out);
        *margin = fminl(*margin, (across / (ld)leg->rod - 1) / 0.05L);
        for (int k = 0; k < 3; k++) {
            const ld shift = across > 0 ? out[k] / across * leg->rod : 0;
            at->from_base[k] += shift;
            at->lever[k] += shift;
        }
    }
}

// Returns the margin of an arm to where inverse subtracts a turn: 1 at 4 degrees, about as far as a cosine of 0.08.
static ld half_turn(ld q) { return (180 - fabsl(q)) / 4; }

// Computes the residual of the length of leg i, its row over D and omega, and the drive's cosine.
static ld residual(const struct machine *m, const ld p[6], ld r[3][3], int i, ld q, ld row[6], ld *margin)
{
    const struct leg *leg = &m->leg[i];
    struct span at;
    ld c[3], move[3], u[3], turning[3];
    spanned(m, p, r, i, &at, margin);
    lower_end(leg, q, c, move);
    for (int k = 0; k < 3; k++) u[k] = at.from_base[k] - (c[k] - leg->base[k]);
    const ld l = norm(u);
    if (!(l > 0)) return NAN;
    for (int k = 0; k < 3; k++) u[k] /= l;
    cross(at.lever, u, turning);
    for (int k = 0; k < 3; k++) {
        row[k] = u[k];
        row[3 + k] = turning[k];
    }
    ld f = l;
    if (leg->kind == STRUT || leg->kind == RING) {
        *margin = fminl(*margin, l / (0.02L * m->size));
        f -= q;
        if (leg->kind == STRUT && leg->lead != 0) {
            ld w[3], z[3], both[3];
            f += nut(leg, m->fold[i], u, l, r, w, z, margin);
            cross(at.lever, w, both);
            for (int k = 0; k < 3; k++) {
                row[k] += w[k];
                row[3 + k] += both[k] + z[k];
            }
        }
    } else {
        f -= leg->rod;
        const ld speed = norm(move);
        *margin = fminl(*margin, fabsl(dot(u, move)) / speed / 0.08L);
        if (leg->kind == CRANK) *margin = fminl(*margin, half_turn(q));
    }
    return f;
}

// Lists the letters that legs move.
static int actives(const struct machine *m, int index[MOST])
{
    int n = 0;
    for (int k = 0; k < 6; k++)
        if (m->letters[k] == 1) index[n++] = k;
    return n;
}

// Computes residuals, and rows over the active letters; angles as lengths at the arm `radius`.
static ld rows_at(const struct machine *m, const ld p[6], const double *q, ld f[LEGS], ld j[LEGS][MOST], int *n)
{
    ld r[3][3], rates[3][3], margin = 1e9L;
    int index[MOST];
    *n = actives(m, index);
    rotation(p, r, rates);
    for (int i = 0; i < (int)m->legs; i++) {
        ld row[6];
        f[i] = residual(m, p, r, i, q[i], row, &margin);
        for (int c = 0; c < *n; c++) {
            const int k = index[c];
            j[i][c] = k < 3 ? row[k] : dot(&row[3], rates[k - 3]) / m->radius;
        }
    }
    return margin;
}

static int is_square(const struct machine *m, int n) { return (int)m->legs == n; }

// Factors a matrix (LU with row pivots); returns the determinant's sign, 0 if it is singular.
static int factored(int n, ld a[MOST][MOST], int pivot[MOST])
{
    int sign = 1;
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int i = c + 1; i < n; i++)
            if (fabsl(a[i][c]) > fabsl(a[best][c])) best = i;
        pivot[c] = best;
        if (!(fabsl(a[best][c]) > 0)) return 0;
        if (best != c) {
            sign = -sign;
            for (int k = 0; k < n; k++) {
                const ld t = a[c][k];
                a[c][k] = a[best][k];
                a[best][k] = t;
            }
        }
        if (a[c][c] < 0) sign = -sign;
        for (int i = c + 1; i < n; i++) {
            const ld t = a[i][c] /= a[c][c];
            for (int k = c + 1; k < n; k++) a[i][k] -= t * a[c][k];
        }
    }
    return sign;
}

static void solved(int n, ld a[MOST][MOST], const int pivot[MOST], ld b[MOST])
{
    for (int c = 0; c < n; c++) {
        const ld t = b[c];
        b[c] = b[pivot[c]];
        b[pivot[c]] = t;
    }
    for (int i = 0; i < n; i++)
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

static void normal(const struct machine *m, int n, ld j[LEGS][MOST], ld a[MOST][MOST])
{
    for (int r = 0; r < n; r++)
        for (int c = 0; c < n; c++) {
            a[r][c] = 0;
            for (int i = 0; i < (int)m->legs; i++) a[r][c] += j[i][r] * j[i][c];
        }
}

// Computes one Gauss-Newton step for residuals f: dx in lengths. Returns the sign of the determinant (1 for least
// squares), 0 if there is no step.
static int step(const struct machine *m, int n, ld j[LEGS][MOST], const ld f[LEGS], ld dx[MOST])
{
    ld a[MOST][MOST];
    int pivot[MOST], sign;
    if (is_square(m, n)) {
        for (int i = 0; i < n; i++) {
            dx[i] = -f[i];
            for (int c = 0; c < n; c++) a[i][c] = j[i][c];
        }
        sign = factored(n, a, pivot);
    } else {
        normal(m, n, j, a);
        for (int c = 0; c < n; c++) {
            dx[c] = 0;
            for (int i = 0; i < (int)m->legs; i++) dx[c] -= j[i][c] * f[i];
        }
        sign = factored(n, a, pivot) ? 1 : 0;
    }
    if (sign) solved(n, a, pivot, dx);
    return sign;
}

static ld length_of(int n, const ld dx[MOST])
{
    ld sum = 0;
    for (int c = 0; c < n; c++) sum += dx[c] * dx[c];
    return sqrtl(sum);
}

static void moved(const struct machine *m, ld p[6], const ld dx[MOST], ld share)
{
    int index[MOST];
    const int n = actives(m, index);
    for (int c = 0; c < n; c++) {
        const int k = index[c];
        p[k] += share * (k < 3 ? dx[c] : dx[c] / m->radius / DEGREE);
    }
}

static void tabled(const struct machine *m, const double *q, ld p[6])
{
    int joint = (int)m->legs;
    for (int k = 0; k < 3; k++)
        if (m->letters[k] == 2) p[k] = q[joint++];
}

// Returns the sign of cos B, a factor of the determinant in Euler angles that does not indicate a singular pose.
static int sheet(const struct machine *m, const ld p[6])
{
    return m->letters[3] == 1 && m->letters[5] == 1 && cosl(p[4] * DEGREE) < 0 ? -1 : 1;
}

// Runs Newton's method at joints q. Returns the sign of the determinant at its end, 0 if it did not converge.
static int corrected(const struct machine *m, const double *q, ld p[6], ld most, ld *went)
{
    ld f[LEGS], j[LEGS][MOST], dx[MOST], last = HUGE_VALL;
    int n;
    *went = 0;
    for (int i = 0; i < 30; i++) {
        rows_at(m, p, q, f, j, &n);
        const int sign = step(m, n, j, f, dx);
        const ld length = length_of(n, dx);
        if (!sign || !(length <= most)) return 0;
        moved(m, p, dx, 1);
        *went += length;
        if (!(*went <= most)) return 0;
        // Least squares converge linearly; rounding ends both.
        if (length <= 1e-15L * m->size || (i > 2 && length >= last && length <= 1e-12L * m->size))
            return sign * sheet(m, p);
        last = length;
    }
    return 0;
}

static void wide(const double *pose, ld p[6])
{
    for (int k = 0; k < 6; k++) p[k] = pose[k];
}

static void narrow(const ld p[6], double *pose)
{
    for (int k = 0; k < 6; k++) pose[k] = (double)p[k];
}

EXPORT int truth_inverse(const struct machine *m, const double *pose, double *q, double *margin);

// Computes the rows at a pose with its joints: near a dead point a drive moves far, and its rod rotates as far.
static void rows_along(const struct machine *m, const ld p[6], const double *q, ld j[LEGS][MOST])
{
    double pose[6], own[16], margin;
    ld f[LEGS];
    int n;
    narrow(p, pose);
    rows_at(m, p, truth_inverse(m, pose, own, &margin) ? q : own, f, j, &n);
}

// Computes the smallest singular value of the rows and the distance of a singular pose along its direction.
static void look(const struct machine *m, const ld p[6], const double *q, struct fold *out)
{
    ld f[LEGS], j[LEGS][MOST], a[MOST][MOST], v[MOST];
    int n, pivot[MOST];
    out->margin = (double)rows_at(m, p, q, f, j, &n);
    out->sign = 0;
    if (is_square(m, n)) {
        for (int i = 0; i < n; i++)
            for (int c = 0; c < n; c++) a[i][c] = j[i][c];
        out->sign = factored(n, a, pivot) * sheet(m, p);
    }
    normal(m, n, j, a);
    for (int c = 0; c < n; c++) v[c] = 1 + 0.1L * c;
    out->sigma = 0;
    out->curvature = out->distance = 0;
    if (!factored(n, a, pivot)) return;
    ld value = 0;
    for (int i = 0; i < 40; i++) {
        const ld length = length_of(n, v);
        for (int c = 0; c < n; c++) v[c] /= length;
        ld w[MOST];
        memcpy(w, v, sizeof w);
        solved(n, a, pivot, w);
        const ld now = 1 / length_of(n, w);
        memcpy(v, w, sizeof w);
        if (i > 3 && fabsl(now - value) <= 1e-4L * now) {
            value = now;
            break;
        }
        value = now;
    }
    const ld length = length_of(n, v);
    for (int c = 0; c < n; c++) v[c] /= length;
    out->sigma = (double)sqrtl(value);
    // Gradient of the singular value, u' dJ v, with the left singular vector u = J v / sigma.
    ld u[LEGS], size = 0, slope = 0;
    for (int i = 0; i < (int)m->legs; i++) {
        u[i] = 0;
        for (int c = 0; c < n; c++) u[i] += j[i][c] * v[c];
        size += u[i] * u[i];
    }
    const ld h = 1e-5L * m->size;
    for (int e = 0; e < n; e++) {
        ld there[6], back[6], unit_e[MOST] = { 0 }, one[LEGS][MOST], other[LEGS][MOST], along = 0;
        unit_e[e] = 1;
        memcpy(there, p, sizeof there);
        memcpy(back, p, sizeof back);
        moved(m, there, unit_e, h);
        moved(m, back, unit_e, -h);
        rows_along(m, there, q, one);
        rows_along(m, back, q, other);
        for (int i = 0; i < (int)m->legs; i++)
            for (int c = 0; c < n; c++) along += u[i] * (one[i][c] - other[i][c]) * v[c];
        along /= 2 * h;
        slope += along * along;
    }
    // At least the value of a leg as long as the machine: terms of higher order bend it elsewhere.
    const ld k = fmaxl(sqrtl(slope / size), 0.2L / m->size);
    out->curvature = (double)k;
    // To first order; beyond this the slope is meaningless.
    out->distance = (double)fminl(sqrtl(value) / k, 0.3L * m->size);
}

// Computes joints; returns 0, or 1 if a leg does not reach.
EXPORT int truth_inverse(const struct machine *m, const double *pose, double *q, double *margin)
{
    ld p[6], r[3][3], least = 1e9L;
    wide(pose, p);
    rotation(p, r, NULL);
    for (int i = 0; i < (int)m->legs; i++) {
        const struct leg *leg = &m->leg[i];
        struct span at;
        spanned(m, p, r, i, &at, &least);
        const ld *w = at.from_base;
        if (leg->kind == STRUT || leg->kind == RING) {
            const ld l = norm(w);
            ld n[3], unused[3], unused2[3];
            for (int k = 0; k < 3; k++) n[k] = w[k] / l;
            least = fminl(least, l / (0.02L * m->size));
            ld value = l;
            if (leg->kind == STRUT && leg->lead != 0)
                value += nut(leg, m->fold[i], n, l, r, unused, unused2, &least);
            q[i] = (double)value;
        } else if (leg->kind == SLIDER) {
            ld g[3];
            unit(leg->first, g);
            const ld h = dot(g, w), rod = leg->rod, square = rod * rod - dot(w, w) + h * h;
            if (!(square > 0)) return 1;
            least = fminl(least, sqrtl(square) / rod / 0.08L);
            q[i] = (double)(h + leg->side * sqrtl(square));
        } else {
            ld k[3], across[3], c[3], move[3], u[3];
            const ld arm[3] = { leg->second[0], leg->second[1], leg->second[2] }, rod = leg->rod;
            unit(leg->first, k);
            cross(k, arm, across);
            const ld axial = dot(k, arm);
            ld flat[3];
            for (int e = 0; e < 3; e++) flat[e] = arm[e] - axial * k[e];
            const ld a = dot(w, flat), b = dot(w, across);
            const ld t = (dot(w, w) + dot(arm, arm) - rod * rod) / 2 - axial * dot(k, w);
            const ld most = hypotl(a, b);
            if (!(fabsl(t) < most)) return 1;
            // Within half a turn of the arm's position at 0.
            q[i] = (double)remainderl((atan2l(b, a) + leg->side * acosl(t / most)) / DEGREE, 360);
            lower_end(leg, q[i], c, move);
            for (int e = 0; e < 3; e++) u[e] = w[e] - (c[e] - leg->base[e]);
            least = fminl(least, fabsl(dot(u, move)) / norm(u) / norm(move) / 0.08L);
            least = fminl(least, half_turn(q[i]));
        }
    }
    int joint = (int)m->legs;
    for (int k = 0; k < 3; k++)
        if (m->letters[k] == 2) q[joint++] = pose[k];
    *margin = (double)least;
    return 0;
}

// Sets the folds of the nut corrections at the reference pose.
EXPORT void truth_fold_at(struct machine *m, const double *pose)
{
    ld p[6], r[3][3], unused = 1e9L;
    wide(pose, p);
    rotation(p, r, NULL);
    for (int i = 0; i < (int)m->legs; i++) {
        const struct leg *leg = &m->leg[i];
        struct span at;
        ld a[3], own[3], b[3];
        m->fold[i] = 1;
        if (leg->kind != STRUT || leg->lead == 0) continue;
        spanned(m, p, r, i, &at, &unused);
        unit(leg->first, a);
        unit(leg->second, own);
        turn(r, own, b);
        const ld l = norm(at.from_base);
        m->fold[i] = dot(a, b) * l * l - dot(a, at.from_base) * dot(b, at.from_base) < 0 ? -1 : 1;
    }
}

EXPORT void truth_look(const struct machine *m, const double *pose, const double *q, struct fold *out)
{
    ld p[6];
    wide(pose, p);
    look(m, p, q, out);
}

// Returns the sign of the determinant; 1 for least squares.
EXPORT int truth_sign(const struct machine *m, const double *pose, const double *q)
{
    ld p[6], f[LEGS], j[LEGS][MOST], dx[MOST];
    int n;
    wide(pose, p);
    rows_at(m, p, q, f, j, &n);
    return step(m, n, j, f, dx) * sheet(m, p);
}

// Computes the deviation of the pose from the equations of the joints: the largest residual, and the next step.
EXPORT void truth_misfit(const struct machine *m, const double *pose, const double *q, double *most, double *next)
{
    ld p[6], f[LEGS], j[LEGS][MOST], dx[MOST], largest = 0;
    int n;
    wide(pose, p);
    rows_at(m, p, q, f, j, &n);
    for (int i = 0; i < (int)m->legs; i++) largest = !(fabsl(f[i]) <= largest) ? fabsl(f[i]) : largest;
    int joint = (int)m->legs;
    ld table = 0;
    for (int k = 0; k < 3; k++)
        if (m->letters[k] == 2) table = fmaxl(table, fabsl(p[k] - q[joint++]));
    *most = (double)fmaxl(largest, table);
    *next = step(m, n, j, f, dx) ? (double)fmaxl(length_of(n, dx), table) : HUGE_VAL;
}

// Returns the distance of two poses as a length.
EXPORT double truth_distance(const struct machine *m, const double *one, const double *other)
{
    ld p[6], o[6], r[3][3], s[3][3], way = 0, turned = 0;
    wide(one, p);
    wide(other, o);
    rotation(p, r, NULL);
    rotation(o, s, NULL);
    for (int k = 0; k < 3; k++) {
        way += (p[k] - o[k]) * (p[k] - o[k]);
        for (int e = 0; e < 3; e++) turned += (r[k][e] - s[k][e]) * (r[k][e] - s[k][e]);
    }
    const ld angle = 2 * asinl(fminl(1, sqrtl(turned / 8)));
    return (double)hypotl(sqrtl(way), m->radius * angle);
}

// Follows the straight line of joints from (q0, pose) to q1, in steps that are short compared with the distance
// of the nearest singular pose. Returns 1 if it arrives, with the pose in `pose`, otherwise 0.
EXPORT int truth_follow(const struct machine *m, const double *q0, double *pose, const double *q1,
                        struct followed *out)
{
    ld p[6], went;
    double q[16], ahead[16];
    struct fold at;
    const int count = (int)m->legs + 3;
    wide(pose, p);
    tabled(m, q0, p);
    memset(out, 0, sizeof *out);
    out->distance = out->margin = HUGE_VAL;
    memcpy(q, q0, count * sizeof *q);
    int side = corrected(m, q, p, 0.05L * m->size, &went);
    if (!side) return 0;
    ld t = 0;
    for (int steps = 0; steps < 400; steps++) {
        look(m, p, q, &at);
        out->distance = fmin(out->distance, at.distance);
        out->margin = fmin(out->margin, at.margin);
        out->steps = steps;
        if (t >= 1) {
            tabled(m, q1, p);
            narrow(p, pose);
            return 1;
        }
        if (!(at.distance > 1e-7 * m->size)) return 0;
        // The tangent.
        ld f[LEGS], j[LEGS][MOST], dx[MOST], here[LEGS];
        int n;
        rows_at(m, p, q, here, j, &n);
        const ld ask = fminl(1e-5L, 1 - t);
        for (int i = 0; i < count; i++) ahead[i] = (double)(q0[i] + (t + ask) * ((ld)q1[i] - q0[i]));
        ld unused[LEGS][MOST];
        int same;
        rows_at(m, p, ahead, f, unused, &same);
        for (int i = 0; i < (int)m->legs; i++) f[i] = (f[i] - here[i]) / ask;
        if (!step(m, n, j, f, dx)) return 0;
        const ld speed = length_of(n, dx), most = 0.1L * fminl(at.distance, 0.5L * m->size);
        ld share = fminl(1 - t, speed > 0 ? most / speed : 1);
        int tries = 0;
        for (; tries < 12; tries++, share /= 2) {
            ld next[6];
            memcpy(next, p, sizeof next);
            moved(m, next, dx, share);
            const ld to = t + share >= 1 ? 1 : t + share;
            for (int i = 0; i < count; i++)
                ahead[i] = to == 1 ? q1[i] : (double)(q0[i] + to * ((ld)q1[i] - q0[i]));
            const int now = corrected(m, ahead, next, 0.5L * fmaxl(most, 1e-12L * m->size), &went);
            if (now == side) {
                out->length += (double)(share * speed);
                memcpy(p, next, sizeof p);
                memcpy(q, ahead, count * sizeof *q);
                t = to;
                break;
            }
        }
        if (tries == 12) return 0;
    }
    return 0;
}

// Runs Newton's method from a nearby pose; returns 1 if it arrives within `most` of it.
EXPORT int truth_near(const struct machine *m, double *pose, const double *q, double most)
{
    ld p[6], went;
    wide(pose, p);
    tabled(m, q, p);
    if (!corrected(m, q, p, most, &went)) return 0;
    narrow(p, pose);
    return 1;
}

// Axes that carry something, in order.
struct chain {
    double count, tool[3], has_holder, holder[3];
    struct {
        double place, carries, axis[3], point[3];
    } link[6];
};

static void carried(const struct chain *c, int n, const double *world, int back, ld x[3])
{
    const int place = (int)c->link[n].place;
    const ld value = back ? -(ld)world[place] : (ld)world[place];
    ld a[3], v[3], across[3];
    unit(c->link[n].axis, a);
    if (place > 5) {
        for (int k = 0; k < 3; k++) x[k] += value * a[k];
        return;
    }
    for (int k = 0; k < 3; k++) v[k] = x[k] - c->link[n].point[k];
    cross(a, v, across);
    const ld s = sinl(value * DEGREE), o = cosl(value * DEGREE), along = dot(a, v);
    for (int k = 0; k < 3; k++)
        x[k] = c->link[n].point[k] + v[k] * o + across[k] * s + a[k] * along * (1 - o);
}

// Computes the pose of D at a pose of LinuxCNC's. Letters of extra axes in `world` do not belong to the machine's
// orientation; `mine` are the letters in the order X Y Z A B C.
EXPORT void truth_pose(const struct machine *m, const struct chain *c, const double *world, const double *angles,
                       double *pose)
{
    ld p[6], r[3][3], w[3], o[3], ro[3], centre[3], rc[3];
    for (int k = 0; k < 3; k++) {
        p[k] = world[k];
        p[3 + k] = angles[k];
        w[k] = (ld)world[k] - c->tool[k];
        o[k] = -(ld)c->tool[k];
        centre[k] = m->centre[k];
    }
    rotation(p, r, NULL);
    const int count = (int)c->count;
    // The innermost axis acts first.
    for (int n = count - 1; n >= 0; n--) {
        if (c->link[n].carries == 1) carried(c, n, world, 0, w);
        if (c->link[n].carries == 2) carried(c, n, world, 0, o);
    }
    for (int k = 0; k < 3; k++) o[k] = -o[k];
    if (c->has_holder != 0) {
        // P = G^-1 (c0 - o') - R w.
        ld x[3], rw[3];
        for (int k = 0; k < 3; k++) x[k] = c->holder[k] - o[k];
        for (int n = 0; n < count; n++)
            if (c->link[n].carries == 3) carried(c, n, world, 1, x);
        turn(r, w, rw);
        for (int k = 0; k < 3; k++) p[k] = x[k] - rw[k];
    } else {
        for (int n = 0; n < count; n++)
            if (c->link[n].carries == 3) carried(c, n, world, 1, w);
        turn(r, o, ro);
        for (int k = 0; k < 3; k++) p[k] = w[k] + ro[k];
    }
    turn(r, centre, rc);
    for (int k = 0; k < 3; k++) p[k] = m->letters[k] == 0 ? 0 : p[k] + rc[k];
    for (int k = 3; k < 6; k++) p[k] = m->letters[k] == 1 ? p[k] : 0;
    narrow(p, pose);
}
