//! Modules, streamed point by point.

use super::data::{held_pose, robtarget, speeddata, speeds, tooldata, wobjdata};
use super::names::{SAME_SPEED, identifier, predefined_speed};
use super::zone::{FINE, zone};
use crate::program::{Conf, Mark, ToolData, WobjData};
use std::io::{self, Write};

/// What is known before the first point.
#[derive(Clone, Debug)]
pub struct RapidPlan {
    /// Name of the program, usually the file's stem; made an identifier.
    pub name: String,
    /// Lines of the head comment.
    pub title: Vec<String>,
    /// Tools, as [`PostedPoint::tool`] indexes them; `tool0` is not declared.
    pub tools: Vec<(String, ToolData)>,
    /// Work objects, as [`PostedPoint::wobj`] indexes them; `wobj0` is not declared.
    pub wobjs: Vec<(String, WobjData)>,
    /// Cutting speeds that occur, mm/s: declared where no predefined name has them. Others are written in place.
    pub speeds: Vec<f64>,
    /// Number of points.
    pub points: usize,
    /// Most points a module; more are split over several, with a main module that loads them in turn.
    pub max_points: Option<usize>,
    /// Speed of rapid travel, mm/s.
    pub rapid_mm_s: f64,
    /// How far a zone may pass a cutting corner, mm.
    pub corner_tolerance_mm: f64,
}

/// One point to move to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostedPoint {
    /// TCP in the work object, mm.
    pub position_mm: [f64; 3],
    /// Orientation in the work object, scalar first, unit norm.
    pub quat: [f64; 4],
    /// Configuration of the joints there.
    pub conf: Conf,
    /// Speed into the point, mm/s; rapid travel has the plan's.
    pub speed_mm_s: f64,
    /// Rapid travel.
    pub rapid: bool,
    /// Stop at the point, whatever comes next.
    pub stop: bool,
    /// Mark in force.
    pub mark: Option<Mark>,
    /// Index into [`RapidPlan::tools`].
    pub tool: u16,
    /// Index into [`RapidPlan::wobjs`].
    pub wobj: u16,
}

/// Position and orientation as the controller holds them: printed, then in single precision.
#[must_use]
pub fn as_written(position_mm: [f64; 3], quat: [f64; 4]) -> ([f64; 3], [f64; 4]) {
    held_pose(position_mm, quat)
}

/// Writes a program as one module, or as parts and a main module that loads and calls them.
///
/// `open` gives the destination of a file by its name (`part.mod`); files are written one after the
/// other, each whole before the next, the main module of a split program first.
#[derive(Debug)]
pub struct RapidWriter<F, W> {
    plan: RapidPlan,
    module: String,
    open: F,
    out: Option<W>,
    files: Vec<String>,
    /// Names of the declared speeds.
    speeds: Vec<(f64, String)>,
    /// The point that waits for the next, which its zone depends on.
    waiting: Option<PostedPoint>,
    before: Option<PostedPoint>,
    mark: Option<Mark>,
    in_part: usize,
    line: Vec<u8>,
}

/// Longest ending of a part's names: `_12345_run`.
const ENDING: usize = 10;

impl<F, W> RapidWriter<F, W>
where
    F: FnMut(&str) -> io::Result<W>,
    W: Write,
{
    /// Writes the head: declarations and, for a split program, the whole main module.
    ///
    /// # Errors
    /// What `open` or the destination reports.
    pub fn new(plan: RapidPlan, open: F) -> io::Result<Self> {
        let module = identifier(&plan.name, ENDING);
        let mut writer = Self {
            plan,
            module,
            open,
            out: None,
            files: Vec::new(),
            speeds: Vec::new(),
            waiting: None,
            before: None,
            mark: None,
            in_part: 0,
            line: Vec::new(),
        };
        writer.head()?;
        Ok(writer)
    }

    /// Adds a point.
    ///
    /// # Errors
    /// What the destination reports.
    pub fn point(&mut self, point: &PostedPoint) -> io::Result<()> {
        if let Some(waiting) = self.waiting.replace(*point) {
            self.movement(&waiting, Some(point))?;
        }
        Ok(())
    }

    /// Writes the last point and the end; the names of all files, the one to start first.
    ///
    /// # Errors
    /// What the destination reports.
    pub fn finish(mut self) -> io::Result<Vec<String>> {
        if let Some(last) = self.waiting.take() {
            self.movement(&last, None)?;
        }
        self.close()?;
        Ok(self.files)
    }

    fn is_split(&self) -> bool {
        self.plan.max_points.is_some_and(|most| self.plan.points > most.max(1))
    }

    fn head(&mut self) -> io::Result<()> {
        let mut text = Vec::new();
        let module = self.module.clone();
        text.extend_from_slice(format!("MODULE {module}\n").as_bytes());
        for line in &self.plan.title {
            let plain: String = line.chars().map(|c| if c.is_ascii_graphic() { c } else { ' ' }).collect();
            text.extend_from_slice(format!("  ! {}\n", plain.trim_end()).as_bytes());
        }
        for (name, data) in self.plan.tools.iter().filter(|(n, _)| !n.eq_ignore_ascii_case("tool0")) {
            tooldata(&mut text, name, data);
        }
        for (name, data) in self.plan.wobjs.iter().filter(|(n, _)| !n.eq_ignore_ascii_case("wobj0")) {
            wobjdata(&mut text, name, data);
        }
        let all = [&self.plan.speeds[..], &[self.plan.rapid_mm_s]].concat();
        self.speeds = speeds(&mut text, &all);
        text.extend_from_slice(b"\n  PROC main()\n    ConfL\\On;\n    ConfJ\\On;\n");
        self.start(&module)?;
        if self.is_split() {
            let most = self.plan.max_points.unwrap_or(usize::MAX).max(1);
            for part in 1..=self.plan.points.div_ceil(most) {
                let (file, run) = (format!("{module}_{part}.mod"), format!("{module}_{part}_run"));
                text.extend_from_slice(format!("    Load\\Dynamic,diskhome\\File:=\"{file}\";\n").as_bytes());
                text.extend_from_slice(format!("    %\"{run}\"%;\n").as_bytes());
                text.extend_from_slice(format!("    UnLoad diskhome\\File:=\"{file}\";\n").as_bytes());
            }
        }
        self.write(&text)
    }

    fn start(&mut self, module: &str) -> io::Result<()> {
        let file = format!("{module}.mod");
        self.out = Some((self.open)(&file)?);
        self.files.push(file);
        Ok(())
    }

    /// Ends the module that is open.
    fn close(&mut self) -> io::Result<()> {
        self.write(b"  ENDPROC\nENDMODULE\n")?;
        match self.out.take() {
            Some(mut out) => out.flush(),
            None => Ok(()),
        }
    }

    fn write(&mut self, text: &[u8]) -> io::Result<()> {
        self.out.as_mut().map_or(Ok(()), |out| out.write_all(text))
    }

    fn next_part(&mut self) -> io::Result<()> {
        self.close()?;
        let part = format!("{}_{}", self.module, self.files.len());
        self.start(&part)?;
        self.in_part = 0;
        self.mark = None; // said again, so that each module reads right by itself
        self.write(format!("MODULE {part}\n  PROC {part}_run()\n").as_bytes())
    }

    fn movement(&mut self, point: &PostedPoint, next: Option<&PostedPoint>) -> io::Result<()> {
        let full = self.plan.max_points.is_some_and(|most| self.in_part >= most.max(1));
        if self.is_split() && (self.files.len() == 1 || full) {
            self.next_part()?;
        }
        let mut line = std::mem::take(&mut self.line);
        line.clear();
        if self.mark != point.mark {
            match point.mark {
                Some(Mark::Air) => line.extend_from_slice(b"    ! deflex air\n"),
                Some(Mark::Cut) => line.extend_from_slice(b"    ! deflex cut\n"),
                None => {}
            }
            self.mark = point.mark;
        }
        // The way to the first point is unknown: joints, not a straight line.
        line.extend_from_slice(if self.before.is_none() { b"    MoveJ " } else { b"    MoveL " });
        robtarget(&mut line, &point.position_mm, &point.quat, point.conf);
        line.push(b',');
        self.speed(&mut line, if point.rapid { self.plan.rapid_mm_s } else { point.speed_mm_s });
        line.push(b',');
        line.extend_from_slice(self.zone_at(point, next));
        line.push(b',');
        let tool = self.plan.tools.get(usize::from(point.tool)).map_or("tool0", |t| t.0.as_str());
        let wobj = self.plan.wobjs.get(usize::from(point.wobj)).map_or("wobj0", |w| w.0.as_str());
        line.extend_from_slice(tool.as_bytes());
        line.extend_from_slice(b"\\WObj:=");
        line.extend_from_slice(wobj.as_bytes());
        line.extend_from_slice(b";\n");
        self.write(&line)?;
        self.line = line;
        self.before = Some(*point);
        self.in_part += 1;
        Ok(())
    }

    fn speed(&self, line: &mut Vec<u8>, mm_s: f64) {
        if let Some(v) = predefined_speed(mm_s) {
            line.extend_from_slice(format!("v{v}").as_bytes());
        } else if let Some((_, name)) = self.speeds.iter().find(|(v, _)| (v - mm_s).abs() < SAME_SPEED) {
            line.extend_from_slice(name.as_bytes());
        } else {
            speeddata(line, mm_s);
        }
    }

    fn ends_part(&self) -> bool {
        self.is_split() && self.plan.max_points.is_some_and(|most| self.in_part + 1 >= most.max(1))
    }

    fn zone_at(&self, point: &PostedPoint, next: Option<&PostedPoint>) -> &'static [u8] {
        let (Some(before), Some(next)) = (&self.before, next) else { return FINE };
        // The tool arrives before it enters the material.
        let enters = point.rapid && !next.rapid;
        if point.stop || enters || self.ends_part() {
            return FINE;
        }
        let [q, p, n] = [before, point, next].map(|p| p.position_mm);
        zone(q, p, n, point.rapid, self.plan.corner_tolerance_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::collections::BTreeMap;
    use std::rc::Rc;

    type Files = Rc<RefCell<BTreeMap<String, Vec<u8>>>>;

    struct InMemory(String, Files);

    impl Write for InMemory {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.1.borrow_mut().entry(self.0.clone()).or_default().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn posted(max_points: Option<usize>) -> Vec<(String, String)> {
        let quat = [0.0, 1.0, 0.0, -0.0];
        let conf = Conf { cf1: 0, cf4: -1, cf6: 0, cfx: 1 };
        let at = |x: f64, speed_mm_s: f64, rapid: bool, mark| PostedPoint {
            position_mm: [x, -0.000_01, 10.0],
            quat,
            conf,
            speed_mm_s,
            rapid,
            stop: false,
            mark,
            tool: 0,
            wobj: 0,
        };
        let points = [
            at(0.0, 0.0, true, None),
            at(10.0, 0.0, true, Some(Mark::Air)),
            at(12.0, 27.432, false, Some(Mark::Cut)),
            at(14.5, 50.0, false, Some(Mark::Cut)),
            at(17.0, 33.0, false, Some(Mark::Cut)),
        ];
        let tool = ToolData {
            robhold: true,
            tcp_mm: [0.0, 0.0, 310.0],
            tcp_quat: [1.0, 0.0, 0.0, 0.0],
            mass_kg: 18.0,
            cog_mm: [0.0, 0.0, 120.0],
        };
        let unit = [1.0, 0.0, 0.0, 0.0];
        let wobj = WobjData {
            robhold: false,
            fixed: true,
            uframe_mm: [1000.0, -400.0, 700.0],
            uframe_quat: unit,
            oframe_mm: [0.0; 3],
            oframe_quat: unit,
        };
        let plan = RapidPlan {
            name: "2 blade".into(),
            title: vec!["from 2 blade.apt".into()],
            tools: vec![("tMill".into(), tool)],
            wobjs: vec![("wPart".into(), wobj)],
            speeds: vec![27.432, 50.0],
            points: points.len(),
            max_points,
            rapid_mm_s: 500.0,
            corner_tolerance_mm: 0.05,
        };
        let files = Files::default();
        let open = |name: &str| Ok(InMemory(name.to_owned(), Rc::clone(&files)));
        let mut writer = RapidWriter::new(plan, open).unwrap();
        for point in &points {
            writer.point(point).unwrap();
        }
        let names = writer.finish().unwrap();
        let text = |n: &String| String::from_utf8(files.borrow()[n].clone()).unwrap();
        names.iter().map(|n| (n.clone(), text(n))).collect()
    }

    #[test]
    fn one_module() {
        let files = posted(None);
        assert_eq!(files.len(), 1);
        insta::assert_snapshot!(files[0].1);
    }

    #[test]
    fn split_into_loadable_parts() {
        let all: Vec<String> = posted(Some(2)).into_iter().map(|(n, t)| format!("--- {n}\n{t}")).collect();
        insta::assert_snapshot!(all.concat());
    }
}
