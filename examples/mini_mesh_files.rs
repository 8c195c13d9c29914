#![allow(unsafe_code, missing_docs)]
use plumbline::mesh::*;
use std::path::Path;
fn cpu()->f64{ let mut t=libc::timespec{tv_sec:0,tv_nsec:0}; unsafe{libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID,&mut t)}; t.tv_sec as f64+t.tv_nsec as f64*1e-9 }
fn main(){
  let out=std::path::PathBuf::from(std::env::args().nth(1).unwrap());
  for f in std::env::args().skip(2){
    let t0=cpu();
    match read_model(Path::new(&f),&ReadLimits::default()) {
      Err(e)=>println!("REFUSED {e}"),
      Ok(m)=>{
        let t1=cpu();
        let r=repair(m.mesh(),&RepairOptions::default());
        let t2=cpu();
        let facts=MeshFacts::of(m.mesh());
        println!("== {f} read {:.3}s repair {:.3}s {:?}\n{facts}\n-- {}", t1-t0,t2-t1,m.warnings(),r.report);
        println!("   comps {:?}", r.report.components.iter().take(3).map(|c|(c.vertices,c.genus,c.boundary_loops,c.volume)).collect::<Vec<_>>());
        let again=repair(&r.mesh,&RepairOptions{weld:Weld::Never,..RepairOptions::default()});
        if !again.report.is_clean(){ println!("!! NOT IDEMPOTENT {}",again.report); }
        let stem=Path::new(&f).file_stem().unwrap().to_str().unwrap().to_owned();
        for (name,model) in [("raw",m.clone()),("rep",m.repaired(&r))] {
        for ext in ["obj","ply","off","stl","gltf","glb"] {
          let p=out.join(format!("{stem}.{name}.{ext}"));
          if let Err(e)=write_model(&p,&model){println!("!! {e}");continue}
          match read_model(&p,&ReadLimits::default()){
            Err(e)=>println!("!! {e}"),
            Ok(b)=>{
              let d=model.mesh().diagonal();
              let exact=!matches!(ext,"stl"|"gltf"|"glb");
              // compare triangle corner positions
              let (x,y)=(model.mesh(),b.mesh());
              if x.triangle_count()!=y.triangle_count(){println!("!! {ext} {} {} triangles",x.triangle_count(),y.triangle_count());continue}
              let mut a:Vec<_>=(0..x.triangle_count()).map(|t|x.corners(t)).collect();
              let mut c:Vec<_>=(0..y.triangle_count()).map(|t|y.corners(t)).collect();
              if ext=="glb"||ext=="gltf" {/* order may differ by material */ let k=|t:&[nalgebra::Point3<f64>;3]|{t.map(|p|[p.x,p.y,p.z].map(|v|(v as f32).to_bits()))}; if model.materials().all.len()>0||model.groups().all.len()>0 {a.sort_by_key(k);c.sort_by_key(k);} }
              let e=a.iter().zip(&c).flat_map(|(p,q)|(0..3).map(move|k|(p[k]-q[k]).norm())).fold(0.0,f64::max)/d;
              if e>if exact{0.0}else{2e-7}{println!("!! {ext} differs by {e:e}")}
              if ext!="stl"&&ext!="glb"&&ext!="gltf"&&(b.faces()!=model.faces()){println!("!! {ext} polygons differ")}
              if ext=="obj"&&(b.texture()!=model.texture()||b.normals()!=model.normals()||b.colors()!=model.colors()||b.groups()!=model.groups()||b.materials().of_face!=model.materials().of_face){println!("!! obj attributes differ")}
              if (ext=="glb"||ext=="gltf")&&(b.texture().is_some()!=model.texture().is_some()||b.normals().is_some()!=model.normals().is_some()||b.materials()!=model.materials() && !model.materials().all.is_empty()&&model.assets().is_some()||b.assets()!=model.assets()){println!("!! {ext} attributes differ {:?} {:?}",b.materials().all.len(),model.materials().all.len())}
              if model.texture().is_none() && model.normals().is_none() && ext!="stl" && y.vertex_count()!=x.vertex_count() {println!("!! {ext} vertices {} {}",y.vertex_count(),x.vertex_count())}
            }
          }
        }}
      }
    }
  }
}
