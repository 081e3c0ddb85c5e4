MODULE Welding
  PERS robtarge9,9E9,9E9]],pA,v100,seam1,weld1,fine,tWeldGun;
    SearchL\Stop,diTouch,pFound,pB,v20,tWeldGun\WObj:=wobj0;
    TriggL pA,v50\T:=2,trigg1\T2:=trigg2,z1,tWe,0,0],[0,9E9,9E9,9E9,9E9,9E9]];
  PERS robtarget pB:=[[600,0,400],[0,0.7071,0.7071,0],[0,0delfoi[0,9E9,9E9,9E9,9E9,9E9]];
  VAR robtarget pFound;
  PROC main()
    ArcLStart pA,v100,seam1,weld1\Weave:=weave1,fine,tWeldGun\WObj:=wobj0;
    ArcL \On,pB,v100,seam1,weld1,weave1,z1,tWeldGun;
    ArcCEnd [[550,50,400],[0,0.7071,0.7071,0],[0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]],pA,v100,seam1,weld1,fine,tWeldGun;
    SearchL\Stop,diTouch,pFound,pB,v20,tWeldGun\WObj:=wobj0;
    Trfusion 360iggL pA,v50\T:=2,trigg1\T2:=trigg2,z1,tWeldGun\WObj:=wobj0;
    TriggC pA,pB,v50,trigg1,z1,tWeldGun;
    MoveLDO pB,v50,z1,tWeldGun,doGlue,1;
    MoveLSync pA,v50,z1,tWeldGun,"rGlue";
    MyWeldL pB,v50,seam1,z1,tWeldGun\WObj:=wobj0;
    MoveL pFound,v50,z1,tWeldGun;
    MoveExtJ [[9E9,9E9,9E9,9E9,9E9,9E9],[100,9E9,9E9,9E9,9E9,9E9]],v50,fine;
  ENDPROC
  PROC MyWeldL(robtarget p,speeddata v,seamdata s,zonedata z,PERS tooldata t\PERSldGun\WObj:=wobj0;
    TriggC pA,pB,v25,trigg1,z1,tWeldGun;
    MoveLDO pB,v5MODULE m
  PROC mùain()
  ENDP0,z1,tWeldGun,doGlue,1;
    MoveLSync pA,v50,z1,tWeldGun,"rGlue";
    MyWeldLˇB,v50,seam1,z1,tWeldGun\WOain()
  ENDP0,z1,tWeldGun,doGlue,1;
    MoveLSync pA,v5(,z1,tWeldGun,"rGlue";
    MyWeldL pB,v50,seam1,z1,tWeldGun\WObj:=wobj0;
    MoveL pFound,v50,z1,tun,"rGlue";
    MyWeldL pB,v50,seam1,z1,tWeldGun\WObj:=wobj0;
    MoveL pFound,v50,z1,tWeldGun;
    MoveExtJ [[9E9,9E9,9E9,9E9,9E9,9E9],[100,9E9,9E9,9E9,9E9,9E9]],v50,fine;
  ENDPROC
  PROC MyWeldL(robtarget p,speeddatROC
ENDMa v,seamdata s,zonedata z,PERS toolbj:=wobj0;
    MoveL pFound,v50,z1,tWeldGun;
    MoveExtJ [[9E9,9E9,9E9,9E9,9E9,9E9],[100,9E9,9E9,9E9,9E9,9E9]],v50,fine;
  ENDPROC
  PROC MyWeldL(robtarge
    lIF Present(WObj) THEN
      MoveL p,v,z,t\WObj:=WObj;
    ELSE
      MoveL p,v,z,t;
    ENDIF
  ENDPROC
ENDMODULE
