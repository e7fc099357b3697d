/* Times Embree 3's any-hit queries on rays from a file. Build and use: see README.md beside this file.
   Triangles: little endian f32 [n,3,3]. Rays: f32 [m,8] = origin xyz, tmin, direction xyz, tmax. */
#include <embree3/rtcore.h>
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static RTCScene scene;
static const float *rays;
static size_t ray_count;

struct job {
    pthread_t thread;
    size_t begin, end, occluded;
    double cpu;
    int width;
};

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static float *read_floats(const char *path, size_t *count) {
    FILE *file = fopen(path, "rb");
    if (!file) {
        perror(path);
        exit(2);
    }
    fseek(file, 0, SEEK_END);
    size_t bytes = ftell(file);
    rewind(file);
    float *data = aligned_alloc(64, (bytes + 127) / 64 * 64);
    if (!data || fread(data, 1, bytes, file) != bytes) {
        fprintf(stderr, "%s: could not be read\n", path);
        exit(2);
    }
    fclose(file);
    *count = bytes / 4;
    return data;
}

/* Embree marks an occluded ray by tfar = -inf. */
static size_t trace1(size_t begin, size_t end) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    size_t occluded = 0;
    for (size_t i = begin; i < end; i++) {
        const float *r = rays + 8 * i;
        struct RTCRay ray = {.org_x = r[0], .org_y = r[1], .org_z = r[2], .tnear = r[3],
                             .dir_x = r[4], .dir_y = r[5], .dir_z = r[6], .tfar = r[7], .mask = -1};
        rtcOccluded1(scene, &context, &ray);
        occluded += ray.tfar == -INFINITY;
    }
    return occluded;
}

static size_t trace8(size_t begin, size_t end) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    size_t occluded = 0;
    for (size_t i = begin; i < end; i += 8) {
        struct RTCRay8 p;
        int valid[8] __attribute__((aligned(32)));
        memset(&p, 0, sizeof p);
        for (int k = 0; k < 8; k++) {
            const float *r = rays + 8 * (i + k < end ? i + k : i);
            valid[k] = i + k < end ? -1 : 0;
            p.org_x[k] = r[0], p.org_y[k] = r[1], p.org_z[k] = r[2], p.tnear[k] = r[3];
            p.dir_x[k] = r[4], p.dir_y[k] = r[5], p.dir_z[k] = r[6], p.tfar[k] = r[7];
            p.mask[k] = -1;
        }
        rtcOccluded8(valid, scene, &context, &p);
        for (int k = 0; k < 8; k++)
            occluded += valid[k] && p.tfar[k] == -INFINITY;
    }
    return occluded;
}

static void *work(void *data) {
    struct job *job = data;
    double start = now(CLOCK_THREAD_CPUTIME_ID);
    job->occluded = (job->width == 8 ? trace8 : trace1)(job->begin, job->end);
    job->cpu = now(CLOCK_THREAD_CPUTIME_ID) - start;
    return NULL;
}

static double run(int width, int threads, size_t *occluded, double *cpu) {
    struct job jobs[64];
    double start = now(CLOCK_MONOTONIC);
    for (int t = 0; t < threads; t++) {
        jobs[t] = (struct job){.begin = ray_count * t / threads, .end = ray_count * (t + 1) / threads, .width = width};
        pthread_create(&jobs[t].thread, NULL, work, &jobs[t]);
    }
    *occluded = 0;
    *cpu = 0;
    for (int t = 0; t < threads; t++) {
        pthread_join(jobs[t].thread, NULL);
        *occluded += jobs[t].occluded;
        *cpu += jobs[t].cpu;
    }
    return now(CLOCK_MONOTONIC) - start;
}

int main(int argc, char **argv) {
    if (argc < 3) {
        fprintf(stderr, "usage: embree_rays TRIANGLES.bin RAYS.bin [REPEATS=5] [MAX_THREADS=2] [robust]\n");
        return 2;
    }
    int repeats = argc > 3 ? atoi(argv[3]) : 5, most = argc > 4 ? atoi(argv[4]) : 2;
    most = most < 1 ? 1 : most > 64 ? 64 : most;
    size_t floats, count;
    float *triangles = read_floats(argv[1], &floats);
    rays = read_floats(argv[2], &count);
    ray_count = count / 8;
    unsigned n = (unsigned)(floats / 9);

    RTCDevice device = rtcNewDevice(NULL);
    scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    if (argc > 5 && !strcmp(argv[5], "robust"))
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    unsigned *index = malloc(sizeof(unsigned) * 3 * n);
    for (unsigned i = 0; i < 3 * n; i++)
        index[i] = i;
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, triangles, 0, 12, 3 * (size_t)n);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, index, 0, 12, n);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    double start = now(CLOCK_MONOTONIC);
    rtcCommitScene(scene);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) {
        fprintf(stderr, "Embree reports an error\n");
        return 1;
    }
    printf("%u triangles, %zu rays, high-quality build %.3f s\n", n, ray_count, now(CLOCK_MONOTONIC) - start);
    for (int width = 1; width <= 8; width += 7)
        for (int threads = 1; threads <= most; threads++) {
            double best = DBL_MAX, best_cpu = DBL_MAX, cpu;
            size_t occluded = 0;
            for (int r = 0; r < repeats; r++) {
                double seconds = run(width, threads, &occluded, &cpu);
                best = seconds < best ? seconds : best;
                best_cpu = cpu < best_cpu ? cpu : best_cpu;
            }
            printf("rtcOccluded%d, %d thread%s: %.3f Mrays/s, %.3f per second of CPU time, %zu occluded (%.4f)\n", width, threads,
                   threads > 1 ? "s" : "", ray_count / best * 1e-6, ray_count / best_cpu * 1e-6, occluded, (double)occluded / ray_count);
        }
    return 0;
}
