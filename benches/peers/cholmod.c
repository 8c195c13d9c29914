/* CHOLMOD beside ours: `cholmod ORDERING A.bin` reads a matrix (see cholesky.py), analyzes, factors and solves it, prints
   one line of JSON. Seconds are CPU seconds of the process, the least of several runs. */
#include <cholmod.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double cpu(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void read_exactly(void *into, size_t size, size_t count, FILE *file) {
    if (fread(into, size, count, file) != count) {
        fprintf(stderr, "the matrix ends early\n");
        exit(65);
    }
}

static cholmod_sparse *read_matrix(const char *path, cholmod_common *c) {
    FILE *file = fopen(path, "rb");
    uint64_t n, nnz;
    if (!file) {
        perror(path);
        exit(65);
    }
    read_exactly(&n, 8, 1, file);
    read_exactly(&nnz, 8, 1, file);
    cholmod_triplet *t = cholmod_l_allocate_triplet(n, n, nnz, -1, CHOLMOD_REAL, c);
    uint32_t *index = malloc(4 * nnz);
    read_exactly(index, 4, nnz, file);
    for (uint64_t k = 0; k < nnz; k++) ((int64_t *)t->i)[k] = index[k];
    read_exactly(index, 4, nnz, file);
    for (uint64_t k = 0; k < nnz; k++) ((int64_t *)t->j)[k] = index[k];
    read_exactly(t->x, 8, nnz, file);
    t->nnz = nnz;
    free(index);
    fclose(file);
    cholmod_sparse *a = cholmod_l_triplet_to_sparse(t, nnz, c);
    cholmod_l_free_triplet(&t, c);
    return a;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: cholmod amd|metis|nesdis A.bin\n");
        return 2;
    }
    cholmod_common c;
    cholmod_l_start(&c);
    cholmod_sparse *a = read_matrix(argv[2], &c);
    long n = a->nrow;
    c.nmethods = 1;
    c.postorder = 1;
    c.method[0].ordering = strcmp(argv[1], "metis") == 0    ? CHOLMOD_METIS
                           : strcmp(argv[1], "nesdis") == 0 ? CHOLMOD_NESDIS
                                                            : CHOLMOD_AMD;
    double analyze = 1e300, best[2][2];
    const int kinds[2] = {CHOLMOD_SIMPLICIAL, CHOLMOD_SUPERNODAL};
    cholmod_dense *b = cholmod_l_allocate_dense(n, 3, n, CHOLMOD_REAL, &c);
    for (long k = 0; k < 3 * n; k++) ((double *)b->x)[k] = sin(k);
    for (int kind = 0; kind < 2; kind++) {
        c.supernodal = kinds[kind];
        double t = cpu();
        cholmod_factor *l = cholmod_l_analyze(a, &c);
        if (cpu() - t < analyze) analyze = cpu() - t;
        double factor = 1e300, solve = 1e300, began = cpu();
        for (int k = 0; k < 200 && (k < 3 || cpu() - began < 0.4); k++) {
            t = cpu();
            cholmod_l_factorize(a, l, &c);
            if (cpu() - t < factor) factor = cpu() - t;
        }
        cholmod_dense *x = NULL, *y = NULL, *e = NULL;
        began = cpu();
        for (int k = 0; k < 200 && (k < 3 || cpu() - began < 0.4); k++) {
            t = cpu();
            cholmod_l_solve2(CHOLMOD_A, l, b, NULL, &x, NULL, &y, &e, &c);
            if (cpu() - t < solve) solve = cpu() - t;
        }
        best[kind][0] = factor;
        best[kind][1] = solve;
        cholmod_l_free_dense(&x, &c);
        cholmod_l_free_dense(&y, &c);
        cholmod_l_free_dense(&e, &c);
        cholmod_l_free_factor(&l, &c);
    }
    printf("{\"nnz\": %.0f, \"flops\": %.0f, \"analyze\": %.6f, \"simplicial\": [%.6f, %.6f], \"supernodal\": [%.6f, %.6f]}\n",
           c.lnz, c.fl, analyze, best[0][0], best[0][1], best[1][0], best[1][1]);
    cholmod_l_free_dense(&b, &c);
    cholmod_l_free_sparse(&a, &c);
    cholmod_l_finish(&c);
    return 0;
}
