// CGAL's mean-curvature-flow skeleton, and a judge of curves that knows nothing of how they were made.
//
//   skeleton cgal MESH.off CURVE.txt     extract with CGAL's defaults; prints CPU seconds
//   skeleton judge MESH.off CURVE.txt [OTHER.txt]    prints inside, centredness, visibility, turning, ends, branches, loops as JSON
//
// A curve is lines `v X Y Z` and `e I J`, numbered from 0. It is resampled at 0.5 % of the diagonal of the mesh's box.
// inside: share of samples inside the surface (parity along three directions, the majority counts). centredness:
// min(r1, r2) / max(r1, r2), r1 the distance to the surface, r2 that to where the ray away from the nearest point leaves it.
// visible: share of vertices from which the nearest sample is seen. turning: sum of the angles between consecutive chords of every
// branch, resampled at the same step, over the length of the curve in diagonals. far: Hausdorff distance to the other curve, in diagonals.
//
// Build: g++ -O3 -march=native -DNDEBUG -I/usr/include/eigen3 skeleton.cpp -lgmp -lmpfr -o skeleton
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/IO/polygon_mesh_io.h>
#include <CGAL/extract_mean_curvature_flow_skeleton.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;
using Vector = Kernel::Vector_3;
using Mesh = CGAL::Surface_mesh<Point>;
using Triangle = Kernel::Triangle_3;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, std::vector<Triangle>::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

static double cpu() {
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

struct Curve {
    std::vector<Point> nodes;
    std::vector<std::array<int, 2>> edges;
};

static int extract(const char* file, const char* out) {
    Mesh mesh;
    if (!CGAL::IO::read_polygon_mesh(file, mesh) || !CGAL::is_triangle_mesh(mesh) || !CGAL::is_closed(mesh)) {
        std::puts("{\"refused\": true}");
        return 0;
    }
    using Skeletonization = CGAL::Mean_curvature_flow_skeletonization<Mesh>;
    Skeletonization::Skeleton skeleton;
    double start = cpu();
    CGAL::extract_mean_curvature_flow_skeleton(mesh, skeleton);
    double seconds = cpu() - start;
    std::ofstream to(out);
    to.precision(17);
    for (auto v : CGAL::make_range(vertices(skeleton))) to << "v " << skeleton[v].point << "\n";
    for (auto e : CGAL::make_range(edges(skeleton))) to << "e " << source(e, skeleton) << " " << target(e, skeleton) << "\n";
    std::printf("{\"cpu\": %.4f}\n", seconds);
    return 0;
}

static Curve read_curve(const char* file) {
    Curve curve;
    std::ifstream from(file);
    std::string line, kind;
    while (std::getline(from, line)) {
        std::istringstream words(line);
        words >> kind;
        if (kind == "v") {
            double x, y, z;
            words >> x >> y >> z;
            curve.nodes.emplace_back(x, y, z);
        } else if (kind == "e") {
            int a, b;
            words >> a >> b;
            curve.edges.push_back({a, b});
        }
    }
    return curve;
}

struct Soup {
    std::vector<Point> points;
    std::vector<std::array<int, 3>> faces;
    std::vector<Triangle> triangles;
    double diagonal = 0;
};

static Soup read_soup(const char* file) {
    Soup soup;
    std::ifstream from(file);
    std::string word;
    size_t vertices, faces, edges;
    from >> word >> vertices >> faces >> edges;
    for (size_t i = 0; i < vertices; i++) {
        double x, y, z;
        from >> x >> y >> z;
        soup.points.emplace_back(x, y, z);
    }
    for (size_t i = 0; i < faces; i++) {
        int n, a, b, c;
        from >> n >> a >> b >> c;
        soup.faces.push_back({a, b, c});
        soup.triangles.emplace_back(soup.points[a], soup.points[b], soup.points[c]);
    }
    CGAL::Bbox_3 box;
    for (auto& t : soup.triangles) box += t.bbox();
    soup.diagonal = std::sqrt(CGAL::squared_distance(Point(box.xmin(), box.ymin(), box.zmin()), Point(box.xmax(), box.ymax(), box.zmax())));
    return soup;
}

static std::vector<Point> resample(const Curve& curve, double step) {
    std::vector<Point> samples(curve.nodes);
    for (auto [a, b] : curve.edges) {
        Vector along = curve.nodes[b] - curve.nodes[a];
        int parts = std::max(1, int(std::ceil(std::sqrt(along.squared_length()) / step)));
        for (int k = 1; k < parts; k++) samples.push_back(curve.nodes[a] + along * (double(k) / parts));
    }
    return samples;
}

// Angles between consecutive chords of all branches between ends and junctions, and of loops without either, in radians.
static double turning(const Curve& curve, double step) {
    std::vector<std::vector<int>> around(curve.nodes.size());
    for (size_t e = 0; e < curve.edges.size(); e++) for (int v : curve.edges[e]) around[v].push_back(int(e));
    std::vector<char> used(curve.edges.size());
    double sum = 0;
    auto follow = [&](int v, int e) {
        std::vector<Point> row{curve.nodes[v]};
        while (!used[e]) {
            used[e] = 1;
            v = curve.edges[e][0] == v ? curve.edges[e][1] : curve.edges[e][0];
            row.push_back(curve.nodes[v]);
            if (around[v].size() != 2) break;
            e = around[v][0] == e ? around[v][1] : around[v][0];
        }
        double length = 0;
        for (size_t i = 1; i < row.size(); i++) length += std::sqrt(CGAL::squared_distance(row[i - 1], row[i]));
        int parts = std::max(1, int(std::round(length / step)));
        std::vector<Point> even{row[0]};
        double walked = 0;
        for (size_t i = 1; i < row.size(); i++) {
            double span = std::sqrt(CGAL::squared_distance(row[i - 1], row[i]));
            while (int(even.size()) < parts && even.size() * length / parts <= walked + span)
                even.push_back(row[i - 1] + (row[i] - row[i - 1]) * ((even.size() * length / parts - walked) / span));
            walked += span;
        }
        even.push_back(row.back());
        for (size_t i = 2; i < even.size(); i++) {
            Vector a = even[i - 1] - even[i - 2], b = even[i] - even[i - 1];
            sum += std::atan2(std::sqrt(CGAL::cross_product(a, b).squared_length()), a * b);
        }
    };
    for (bool knots : {true, false})
        for (size_t v = 0; v < around.size(); v++)
            if ((around[v].size() != 2) == knots)
                for (int e : around[v]) if (!used[e]) follow(int(v), e);
    return sum;
}

static double hausdorff(const std::vector<Point>& a, const std::vector<Point>& b) {
    double farthest = 0;
    for (auto [one, other] : {std::pair(&a, &b), std::pair(&b, &a)})
        for (auto& p : *one) {
            double nearest = INFINITY;
            for (auto& q : *other) nearest = std::min(nearest, CGAL::squared_distance(p, q));
            farthest = std::max(farthest, nearest);
        }
    return std::sqrt(farthest);
}

static bool inside(const Tree& tree, const Point& p) {
    const Vector directions[3] = {{0.9123, 0.3071, 0.2711}, {-0.1931, 0.8317, -0.5205}, {0.4409, -0.5127, 0.7368}};
    int odd = 0;
    for (auto& d : directions) odd += tree.number_of_intersected_primitives(Kernel::Ray_3(p, d)) % 2;
    return odd >= 2;
}

static double centredness(const Tree& tree, const Point& c) {
    Point near = tree.closest_point(c);
    Vector away = c - near;
    double r1 = std::sqrt(away.squared_length());
    if (r1 == 0) return 0;
    away = away / r1;
    auto hit = tree.first_intersection(Kernel::Ray_3(c, away));
    if (!hit) return 0;
    const Point* q = boost::get<Point>(&hit->first);
    if (!q) return 0;
    double r2 = std::sqrt(CGAL::squared_distance(c, *q));
    return std::min(r1, r2) / std::max(r1, r2);
}

static int judge(const char* mesh_file, const char* curve_file, const char* other_file) {
    Soup soup = read_soup(mesh_file);
    Curve curve = read_curve(curve_file);
    Tree tree(soup.triangles.cbegin(), soup.triangles.cend());
    tree.accelerate_distance_queries();
    std::vector<Point> samples = resample(curve, 0.005 * soup.diagonal);
    double far = other_file ? hausdorff(samples, resample(read_curve(other_file), 0.005 * soup.diagonal)) / soup.diagonal : -1;
    double turned = turning(curve, 0.005 * soup.diagonal);
    double in = 0;
    std::vector<double> central;
    for (auto& p : samples) {
        in += inside(tree, p);
        central.push_back(centredness(tree, p));
    }
    std::vector<char> named(soup.points.size());
    for (auto& f : soup.faces) for (int v : f) named[v] = 1;
    size_t seen = 0, all = 0;
    for (size_t v = 0; v < soup.points.size(); v++) {
        if (!named[v]) continue;
        all++;
        const Point& p = soup.points[v];
        auto nearest = std::min_element(samples.begin(), samples.end(), [&](const Point& a, const Point& b) {
            return CGAL::squared_distance(p, a) < CGAL::squared_distance(p, b);
        });
        Kernel::Segment_3 sight(p + (*nearest - p) * 1e-6, *nearest);
        std::vector<Tree::Primitive_id> hits;
        tree.all_intersected_primitives(sight, std::back_inserter(hits));
        bool blocked = std::any_of(hits.begin(), hits.end(), [&](auto id) {
            auto& f = soup.faces[id - soup.triangles.cbegin()];
            return f[0] != int(v) && f[1] != int(v) && f[2] != int(v);
        });
        seen += !blocked;
    }
    std::vector<int> degree(curve.nodes.size()), parent(curve.nodes.size());
    std::iota(parent.begin(), parent.end(), 0);
    auto root = [&](int v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    int components = curve.nodes.size();
    double length = 0;
    for (auto [a, b] : curve.edges) {
        degree[a]++, degree[b]++;
        length += std::sqrt(CGAL::squared_distance(curve.nodes[a], curve.nodes[b]));
        if (root(a) != root(b)) components--, parent[root(a)] = root(b);
    }
    int loops = int(curve.edges.size()) - int(curve.nodes.size()) + components;
    double mean = std::accumulate(central.begin(), central.end(), 0.0) / std::max<size_t>(central.size(), 1);
    std::sort(central.begin(), central.end());
    double p10 = central.empty() ? 0 : central[central.size() / 10];
    std::printf("{\"nodes\": %zu, \"ends\": %d, \"branches\": %d, \"loops\": %d, \"components\": %d, \"length\": %.6g, "
                "\"inside\": %.4f, \"central\": %.4f, \"p10\": %.4f, \"visible\": %.4f, \"turning\": %.4f, \"far\": %.4f}\n",
                curve.nodes.size(), int(std::count(degree.begin(), degree.end(), 1)),
                int(std::count_if(degree.begin(), degree.end(), [](int d) { return d > 2; })), loops, components,
                length / soup.diagonal, in / std::max<size_t>(samples.size(), 1), mean, p10, double(seen) / all,
                turned * soup.diagonal / std::max(length, 1e-300), far);
    return 0;
}

int main(int argc, char** argv) {
    if (argc == 4 && std::string(argv[1]) == "cgal") return extract(argv[2], argv[3]);
    if ((argc == 4 || argc == 5) && std::string(argv[1]) == "judge") return judge(argv[2], argv[3], argc == 5 ? argv[4] : nullptr);
    std::fputs("usage: skeleton cgal|judge MESH.off CURVE.txt [OTHER.txt]\n", stderr);
    return 2;
}
