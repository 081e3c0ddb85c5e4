use super::Number;
use super::block::Block;
use super::model::Model;
use deflex_effects::{Deflection, Load, Offset, Parts, State};
use deflex_lanes::{Frame, Mask, SinCos, Vector, six, widest};
use deflex_robot::kinematics::{Chain, Rows, Six, dot};

/// Mixing coefficients at which the secant is used: those of loop gains between −0.9 and 0.9.
pub(super) const STABLE: std::ops::Range<f64> = -9.0..0.475;

/// The arms in one state: their poses, their loads, and their deflections under these loads.
#[derive(Default)]
pub(super) struct Evaluation<R> {
    /// The offsets, which do not depend on the load, and with them the actual rows, work object and TCP.
    pub(super) offset: Offset<R>,
    rows: Rows<R>,
    base_from_wobj: Frame<R>,
    flange_from_tcp: Frame<R>,
    /// Sines and cosines of the Denavit-Hartenberg angles.
    pub(super) joints: [SinCos<R>; 6],
    pub(super) chain: Chain<R>,
    pub(super) base_from_tcp: Frame<R>,
    /// Position of the actual TCP in the actual work object, m.
    seen: Vector<R>,
    /// Its shift from the wanted position, feed frame, m.
    shift: Vector<R>,
    /// Direction of the tool axis, tip to spindle, feed frame.
    axis: Vector<R>,
    /// Force of the cutting law, feed frame, N.
    pub(super) force: Vector<R>,
    pub(super) load: Load<R>,
    /// The deflections under these loads.
    pub(super) give: Deflection<R>,
}

/// The feedback of the depth of cut, lane by lane. The scalar form is `Feedback`, of the command.
#[derive(Default)]
pub(super) struct Feedback<R> {
    /// Change of the joints' deflection for a lift of the tip along the surface normal, rad/m.
    pub(super) yielding: Six<R>,
    /// Estimated mixing coefficient of forward equilibria nearby.
    pub(super) mixing: R,
    /// Estimated lift of the tip above the wanted pose if the motors stand at the angles of the nominal arm there, m.
    pub(super) lift: R,
}

impl<R: Number> Evaluation<R> {
    /// Computes the offsets at the commanded angles of the block.
    pub(super) fn set_offsets(&mut self, model: &Model<'_>, block: &Block<'_, R>) {
        widest!(<R: Number; 'a, 'b, 's> (
            model: &'a Model<'b> = model,
            block: &'a Block<'s, R> = block,
            at: &'a mut Evaluation<R> = self,
        ) {
            at.find_offsets(model, block);
        });
    }

    #[inline(always)]
    fn find_offsets(&mut self, model: &Model<'_>, block: &Block<'_, R>) {
        let (parts, offset) = (model.parts, &mut self.offset);
        (offset.joints, offset.lost) = ([R::ZERO; 6], [R::ZERO; 6]);
        if parts.moves_geometry() {
            *offset = Offset::default();
        }
        for law in &model.laws {
            law.offset(&block.site, offset);
        }
        self.rows = model.robot.rows();
        if parts.has(Parts::ROWS) {
            let nominal = model.robot.links.rows();
            for i in 0..6 {
                let add = &offset.rows[i];
                self.rows.a[i] = self.rows.a[i] + add.a;
                self.rows.d[i] = self.rows.d[i] + add.d;
                self.rows.theta[i] = self.rows.theta[i] + add.theta;
                self.rows.alpha[i] = SinCos::of(add.alpha + nominal[i].alpha);
            }
        }
        self.flange_from_tcp = block.flange_from_tcp;
        if parts.has(Parts::TCP) {
            self.flange_from_tcp = block.flange_from_tcp.then(&offset.tcp.pose());
        }
        self.base_from_wobj = block.site.base_from_wobj;
        if parts.has(Parts::WOBJ) {
            self.base_from_wobj = self.base_from_wobj.then(&offset.wobj.pose());
        }
    }

    /// Sets the actual motor angles, rad.
    #[inline(always)]
    pub(super) fn turn_to(&mut self, model: &Model<'_>, motor: &Six<R>) {
        self.joints = model.robot.joints(&self.rows.theta, motor);
    }

    /// Computes the frames of the links and the pose of the cutter under a deflection.
    pub(super) fn place(&mut self, model: &Model<'_>, block: &Block<'_, R>, under: &Deflection<R>) {
        widest!(<R: Number; 'a, 'b, 's> (
            model: &'a Model<'b> = model,
            block: &'a Block<'s, R> = block,
            under: &'a Deflection<R> = under,
            at: &'a mut Evaluation<R> = self,
        ) {
            at.find_place(model, block, under);
        });
    }

    #[inline(always)]
    fn find_place(&mut self, model: &Model<'_>, block: &Block<'_, R>, under: &Deflection<R>) {
        let parts = model.parts;
        let chain = &mut self.chain;
        self.rows.chain(&self.joints, parts.has(Parts::TILT).then_some(&under.tilt), chain);
        if parts.has(Parts::BASE) {
            let base = under.base.small();
            for i in 0..6 {
                chain.links[i] = base.then(&chain.links[i]);
                chain.axes[i] = base.turn(chain.axes[i]);
            }
        }
        let mut flange = chain.links[5];
        if parts.has(Parts::FLANGE) {
            flange = flange.turned_by(under.flange);
        }
        let mut tcp = flange.then(&self.flange_from_tcp);
        if parts.has(Parts::TIP) {
            tcp.origin = tcp.origin + flange.turn(block.flange_from_tcp.turn(under.tip));
        }
        if parts.has(Parts::LAG) {
            tcp.origin = tcp.origin + self.offset.lag;
        }
        let mut tip = tcp.origin;
        if parts.has(Parts::PART) {
            tip = tip - under.part;
        }
        self.seen = self.base_from_wobj.turn_back(tip - self.base_from_wobj.origin);
        self.shift = block.wobj_from_feed.turn_back(self.seen - block.site.wanted);
        // The tool axis, tip to spindle, is −z of the TCP frame.
        self.axis = -block.wobj_from_feed.turn_back(self.base_from_wobj.turn_back(tcp.z));
        self.base_from_tcp = tcp;
    }

    /// Computes the cutting force at that pose.
    pub(super) fn cut(&mut self, block: &Block<'_, R>) {
        block.forces(&self.shift, &self.axis, &mut self.force);
    }

    /// Computes the cutting force at a pose of the TCP in the work object.
    pub(super) fn cut_at(&mut self, block: &Block<'_, R>, pose: &Frame<R>) {
        let shift = block.wobj_from_feed.turn_back(pose.origin - block.site.wanted);
        let axis = -block.wobj_from_feed.turn_back(pose.z);
        block.forces(&shift, &axis, &mut self.force);
    }

    /// Computes all loads and the deflections under them.
    pub(super) fn bear(&mut self, model: &Model<'_>, block: &Block<'_, R>) {
        widest!(<R: Number; 'a, 'b, 's> (
            model: &'a Model<'b> = model,
            block: &'a Block<'s, R> = block,
            at: &'a mut Evaluation<R> = self,
        ) {
            at.take_loads(model, block);
            at.yield_to_loads(model, block);
        });
    }

    #[inline(always)]
    fn take_loads(&mut self, model: &Model<'_>, block: &Block<'_, R>) {
        let parts = model.parts;
        let Self { chain, base_from_tcp, load, .. } = self;
        let state = State { stiffness: model.stiffness, chain, base_from_tcp, site: &block.site };
        load.start(block.site.base_from_wobj.turn(block.wobj_from_feed.turn(self.force)), parts);
        for law in &model.laws {
            law.load(&state, load);
        }
        load.fill_torque(model.robot, chain, base_from_tcp.origin);
    }

    #[inline(always)]
    fn yield_to_loads(&mut self, model: &Model<'_>, block: &Block<'_, R>) {
        let Self { chain, base_from_tcp, load, give, .. } = self;
        let state = State { stiffness: model.stiffness, chain, base_from_tcp, site: &block.site };
        give.clear(model.parts);
        for law in &model.laws {
            law.deflect(&state, load, give);
        }
    }

    /// Actual TCP in the actual work object.
    #[inline(always)]
    pub(super) fn wobj_from_tcp(&self) -> Frame<R> {
        let (wobj, tcp) = (&self.base_from_wobj, &self.base_from_tcp);
        Frame { x: wobj.turn_back(tcp.x), y: wobj.turn_back(tcp.y), z: wobj.turn_back(tcp.z), origin: self.seen }
    }

    /// The motion in the base frame that moves the TCP from its actual pose to a pose in the work object; `part` is the shift of the part, m,
    /// base axes.
    #[inline(always)]
    pub(super) fn motion_to(&self, wobj_from_tcp: &Frame<R>, part: Option<Vector<R>>) -> Frame<R> {
        let mut wanted = self.base_from_wobj.then(wobj_from_tcp);
        if let Some(part) = part {
            wanted.origin = wanted.origin + part;
        }
        wanted.without(&self.base_from_tcp)
    }

    /// The feedback of the depth of cut in a state in which the tip is at the wanted pose. `aside` is the difference of the motor angles
    /// without a correction from those of this state, rad, before the feedback acts.
    #[inline(always)]
    pub(super) fn feedback(&self, model: &Model<'_>, block: &Block<'_, R>, aside: &Six<R>) -> Feedback<R> {
        let in_base = |v: Vector<R>| block.site.base_from_wobj.turn(block.wobj_from_feed.turn(v));
        let mut slope = in_base(block.slope);
        if model.parts.has(Parts::CUT) {
            // Effects that change the force change its slope by the same factor.
            let law = in_base(self.force);
            let square = law.dot(law);
            let factor = R::ZERO.lt(square).select(self.load.cut.dot(law) / square, R::of(1.0));
            slope = slope * factor;
        }
        let normal = block.site.base_from_wobj.turn(block.wobj_from_feed.z);
        // Motion of the tip along the normal for a turn of each motor, and deflection of each motor for a lift of the tip.
        let levers = six!(i => self.chain.axes[i].cross(self.base_from_tcp.origin - self.chain.links[i].origin));
        let levers = model.robot.by_motor(&levers);
        let lifts = six!(i => levers[i].dot(normal));
        let yielding = six!(i => levers[i].dot(slope) * model.compliance[i]);
        let around = dot(&lifts, &yielding);
        let mixing = around / (around - 1.0);
        let stable = mixing.ge(STABLE.start) & mixing.lt(STABLE.end);
        let mixing = stable.select(mixing, R::ZERO);
        let lift = dot(&lifts, aside) * (R::of(1.0) - mixing);
        Feedback { yielding: six!(i => stable.select(yielding[i], R::ZERO)), mixing, lift }
    }
}

/// The TCP of the nominal arm in the work object, at motor angles in rad.
#[inline(always)]
pub(super) fn nominal<R: Number>(model: &Model<'_>, block: &Block<'_, R>, motor: &Six<R>) -> Frame<R> {
    let rows = model.robot.rows::<R>();
    let base_from_flange = rows.end(&model.robot.joints(&rows.theta, motor));
    block.site.base_from_wobj.back_to(&base_from_flange.then(&block.flange_from_tcp))
}
