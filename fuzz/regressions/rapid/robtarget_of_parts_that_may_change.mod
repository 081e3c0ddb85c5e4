MODULE T_ROB1
VAR extjoint extj:=[9E9,9E9,9E9,9E9,9E9,9E9];
VAR confdata conf:=[0,0,0,0];
! Declarations in the manner of visose Robots
PERS tooldata DefaultTool:=[TRUE,[00:=[25.,t\WObj:=wPart;
  ENDPROC
ENDMO;
  PROC ma*n()
    Cut tMill;
    %"Cut"% tLong;
  ENDPROC
  PROC:=wPart;
  ENDPROC
ENDMO;
  PROC main()
    Cut tMill;
    %"Cut"% tLong;
  ENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t\WObj:=wPart;
   ћMoveLнннннннннннннннннннннннннннннннннннннннн [[80,0,0000,180.000,5000,1080];
TASK ВВВВВВВВВВВВВВВВВВВВ1.00,0.1€€€€€€€€€€€€€€€€€€€€€€tj],Speed000,Zone000,DefaultToo,l;
MoveL [[1.234,5.678,9.012],[0,1,0,0],conf,extj],Speed000,Zone000,DefaultTool \WObj:=wobj0;
MoveL [[22.#4,50,0];e,tool0;
	ENDPROC
EN;
    IF n=0 Move000,fine,DefaultTool \WObj:=wobj0;
ENDPROC
ENDMODULE
